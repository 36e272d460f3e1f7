"""Gradients: against tangents of the same run, which they equal to rounding, against the exact
equation of one freedom, and against differences of runs."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, gradient, load_scene
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.adjoint_following import AdjointFollowing
from alf_ros.studies.exact.exact_tangents import double_four_bar, slider_crank
from alf_ros.studies.gradients.legs import RunInstant
from alf_ros.studies.gradients.observed_number import observed_number
from alf_ros.studies.gradients.taped_run import TapedRun
from alf_ros.studies.optimisation.folds import FOLDS
from support.arm import arm
from support.dot_products import dot_products
from support.some_scenes import SOME_SCENES
from support.tangent_robot import NUMBERS, ROBOT
from support.thorough import LONG, combined, thinned

FIXED: dict[str, Any] = {'step': 1e-2 / 7.0}
ARM = arm(1.0)
ADAPTIVE: dict[str, Any] = {'step': 0.1, 'integrator': 'dop853_adaptive', 'tolerance': 1e-8}


@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = Path(tmp_path_factory.mktemp('robot')) / 'robot.yaml'
    path.write_text(ROBOT, 'utf-8')
    return load_scene(path)


@pytest.mark.parametrize(
    ('solution', 'settings'),
    combined(
        [slider_crank, double_four_bar],
        [pytest.param(FIXED, id='fixed'), pytest.param(ADAPTIVE, id='adaptive')],
    ),
)
def test_equals_the_tangents_through_singular_passes(
    solution: Any, settings: dict[str, Any]
) -> None:
    exact = solution(2.0)
    steps = round(2.0 / settings['step'])
    scene = load_scene(exact.scene)
    expected, found, size = dot_products(scene, exact.names, steps, **settings)
    # stages beside a pass are interpolated: rounding leaves 1e-10 of a derivative there
    assert (np.abs(found - expected) <= 1e-9 * size).all()


@pytest.mark.parametrize(
    ('steps', 'settings'),
    thinned(
        [
            pytest.param(200, {}, id='short'),
            pytest.param(20, {'step': 1e-2}, id='rk4'),
            pytest.param(10, {'step': 2e-2, 'integrator': 'dop853'}, id='dop853'),
        ],
        keep=lambda steps, settings: steps != 10,
    ),
)
def test_equals_the_tangents_for_all_kinds_of_numbers(
    robot: Scene, steps: int, settings: dict[str, Any]
) -> None:
    """Also where bars turn so far in a step that it is added up along arcs."""
    steps = steps if LONG else min(steps, 60)
    expected, found, size = dot_products(robot, NUMBERS, steps, **settings)
    for name, one, other, scale in zip(NUMBERS, found, expected, size, strict=True):
        assert abs(one - other) <= 1e-13 * scale, name


def is_number(scene: Scene, name: str) -> bool:
    try:
        return np.isfinite(overrides.number(scene, name))
    except InputError:
        return False


@pytest.mark.parametrize('name', SOME_SCENES)
def test_equals_the_tangents_in_every_scene(name: str) -> None:
    """All rows, spaces and effects of the library; by masses, where there are parameters."""
    scene = load_scene(name)
    names = [f'{body.name}.mass' for body in scene.mechanism.bodies]
    names = [name for name in (*names, 'gravity.acceleration.1') if is_number(scene, name)][:3]
    try:
        expected, found, size = dot_products(scene, names, 40)
    except InputError as error:
        assert 'no tangent' in str(error)
        return
    # some derivatives are zero, as that of a pendulum by its mass: then terms cancel
    assert (np.abs(found - expected) <= 1e-11 * size.max(initial=0.0) + 1e-14).all()


@pytest.mark.thorough
def test_exact_over_ten_seconds() -> None:
    """B of the slider-crank after 10 s and eleven passes."""
    exact = slider_crank(10.0)
    simulation = Simulation(load_scene(exact.scene), **ADAPTIVE)
    sample = simulation.sample()
    found = gradient(simulation, 'final(points.B.x)', exact.names, duration=10.0, every=100)
    at = int(sample.model.point_block[sample.model.point_names.index('B')])
    tangents = Simulation(load_scene(exact.scene), tangents=exact.names, **ADAPTIVE)
    tangents.step(100)
    for name, dq in zip(exact.names, exact.dq, strict=True):
        own = tangents.sample().tangents[name].points['B'][0]
        assert found.by[name] == pytest.approx(own, rel=1e-8)
        assert abs(found.by[name] - own) <= 1e-7 * np.abs(dq).max(), at
    assert simulation.step_index == 0


# ------------------------------------------------------------------------ numbers of a run

OBSERVED = (
    'final(points.B.x)',
    'final(velocities.B.y)',
    'mean(knee.position)',
    'rms(knee.velocity)',
    'integral(abs(foot.velocity))',
    'max(norm(velocities.B))',
    'min(points.A.y)',
    'max(norm(reactions.knee.force))',
    'final(energy)',
    'min(joints.pin.effort)',
    'final(reactions.foot.force.x)',
)
# of each fold, and of each kind of quantity, one stays
REPEATED = (
    'final(velocities.B.y)',
    'max(norm(velocities.B))',
    'min(points.A.y)',
    'mean(knee.position)',
    'integral(abs(foot.velocity))',
    'final(reactions.foot.force.x)',
)


CHANGED = ('m', 'a', 'pull.stiffness', 'initial.velocities.A.0')


@pytest.fixture(scope='module')
def changed(robot: Scene) -> Callable[[str, float], Simulation]:
    """The robot at its start, with a number changed; each is made once."""

    @functools.cache
    def made(name: str, change: float) -> Simulation:
        text = repr(overrides.number(robot, name) + change)
        return Simulation(overrides.with_changes(robot, {name: text}))

    return made


@pytest.mark.parametrize(
    'n', thinned(range(len(OBSERVED)), keep=lambda n: OBSERVED[n] not in REPEATED)
)
def test_numbers_of_a_run(
    robot: Scene, changed: Callable[[str, float], Simulation], n: int
) -> None:
    """Against differences of sixth order of runs with other numbers."""
    of = OBSERVED[n]
    weights = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
    duration = 0.2 if LONG else 0.1
    found = gradient(Simulation(robot), of, CHANGED, duration=duration, every=1)

    def value(name: str, change: float) -> float:
        return gradient(changed(name, change), of, ['rub.viscous'], duration=duration).value

    for name in CHANGED if LONG else [CHANGED[n % 4]]:
        size = 1e-3 * overrides.number(robot, name)
        slopes = [
            w / size * (value(name, k * size) - value(name, -k * size))
            for k, w in enumerate(weights, 1)
        ]
        assert found.by[name] == pytest.approx(sum(slopes), rel=2e-7, abs=1e-10), name


@pytest.mark.parametrize('n', range(0, len(OBSERVED), 1 if LONG else 3))
def test_numbers_of_an_implicit_run(robot: Scene, n: int) -> None:
    """Against the gradient of an explicit run."""
    found, expected = (
        gradient(
            Simulation(robot, integrator=integrator, tolerance=tolerance),
            OBSERVED[n],
            CHANGED,
            duration=0.2 if LONG else 0.1,
            every=1,
        )
        for integrator, tolerance in (('esdirk43_adaptive', 1e-9), ('dop853_adaptive', 1e-12))
    )
    for name in CHANGED:
        assert found.by[name] == pytest.approx(expected.by[name], rel=1e-5, abs=1e-8), name


@pytest.mark.parametrize(
    ('name', 'quantity'),
    thinned(
        [
            ('delta_robot', 'reactions.motor0.force.x'),
            ('rolling_disk', 'reactions.rim.force.z'),
            ('screw_jack', 'energy'),
            ('stewart_platform', 'kinetic_energy'),
            ('bricard', 'powers.gravity'),
            ('wheeled_robot', 'energy'),
        ],
        keep=lambda name, quantity: name not in ('stewart_platform', 'wheeled_robot'),
    ),
)
def test_quantities_equal_their_tangents(name: str, quantity: str) -> None:
    """In space, with wheels, screws, drives and redundant rows: a sample differentiates along the
    tangents of its state, a gradient along the free directions."""
    scene, names = load_scene(name), ['gravity.acceleration.1', 'gravity.acceleration.2']
    names = [name for name in names if is_number(scene, name)]
    followed = Simulation(scene, tangents=names)
    followed.step(20)
    found = gradient(Simulation(scene), f'final({quantity})', names, duration=followed.t)
    sample = followed.sample()
    expected = np.array([sample.tangents[each].of(quantity) for each in names])
    size = max(np.abs(expected).max(), 1e-3 * abs(found.value))
    assert np.abs(np.array(list(found.by.values())) - expected).max() <= 1e-9 * size


def test_a_share_of_redundant_joints_has_no_gradient() -> None:
    simulation = Simulation(load_scene('bricard'))
    with pytest.raises(InputError, match='one of many that balance'):
        gradient(simulation, 'final(reactions.j0.force.x)', ['gravity.acceleration.1'], 0.01)


def test_in_legs(robot: Scene) -> None:
    """A run in many legs, of which one at a time is in memory, has the same derivatives."""
    whole = TapedRun(Simulation(robot), CHANGED)
    pieces = TapedRun(Simulation(robot), CHANGED, memory=1.0)
    found = []
    for run, count in ((whole, 1), (pieces, 60)):
        assert len(list(run.go_on(60))) == count
        sample = run._simulation.sample()
        number = observed_number('points.B.x', 'of', sample, run.displaced)
        weights = {RunInstant(60): 1.0, RunInstant(31): 0.5, RunInstant(0, begins=True): 2.0}
        found.append(run.derivatives(number, weights))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-11)
    pieces.restart()
    list(pieces.go_on(60))
    again = pieces.derivatives(number, weights)
    np.testing.assert_array_equal(again, found[1])


SPRINGS: dict[str, Any] = {
    'effects.spring': '{between: [B, O], at: [~, ~], stiffness: 30, free_length: 0.7}',
    'effects.damper': '{between: [B, O], damping: 0.1}',
    'effects.drag': '{on: coupler, linear: 0.1}',
}


def test_columns_equal_traces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces of small mechanisms are differentiated along columns, all others are traced."""
    scene = overrides.with_changes(load_scene('slider_crank'), SPRINGS)
    names = ('m', 'gravity.acceleration.1', 'spring.stiffness', 'damper.damping')
    _, columns, size = dot_products(scene, names, 200, **FIXED)
    monkeypatch.setattr('alf_ros.simulation.adjoint_following.fit_columns', lambda *_: False)
    _, traces, _ = dot_products(scene, names, 200, **FIXED)
    assert np.all(np.abs(columns - traces) <= 1e-12 * size)
    assert np.all(columns != 0.0)


def test_traces_and_records_grow(robot: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Too little memory is noticed, and the leg repeated."""
    names, settings = NUMBERS[:3], {**ADAPTIVE, 'step': 0.05}
    expected = gradient(Simulation(robot, **settings), OBSERVED[0], names, duration=0.2)
    monkeypatch.setattr('alf_ros.simulation.adjoint_following.OPERATIONS', 1)
    monkeypatch.setattr('alf_ros.studies.gradients.taped_run._INNER', 1)
    assert gradient(Simulation(robot, **settings), OBSERVED[0], names, duration=0.2) == expected


def test_inputs_that_are_held(robot: Scene) -> None:
    """From a state on the way, with a wrench and an effort held."""
    simulation = Simulation(robot, tangents=['m', 'pull.stiffness'])
    simulation.apply_wrench('rocker', force=[1.0, 2.0], torque=0.3)
    simulation.apply_effort('wrist', 0.4)
    plain = Simulation(robot)
    plain.restore(Simulation(robot).state)
    plain.apply_wrench('rocker', force=[1.0, 2.0], torque=0.3)
    plain.apply_effort('wrist', 0.4)
    found = gradient(plain, 'final(points.B.x)', ['m', 'pull.stiffness'], duration=0.1)
    simulation.step(100)
    for name, slope in found.by.items():
        expected = simulation.sample().tangents[name].points['B'][0]
        assert slope == pytest.approx(expected, rel=1e-12)


# --------------------------------------------------------------------------------- refusals


def refused(source: Any, of: Any, by: Any, **settings: Any) -> str:
    with pytest.raises(InputError) as caught:
        gradient(source, of, by, **settings)
    text = str(caught.value)
    assert '\n' not in text
    return text


def test_what_is_refused(robot: Scene) -> None:
    simulation = Simulation(robot)
    for of, told in (
        ('points.B.x', 'not a number of a run'),
        ('final(B.z)', 'no such quantity'),
        ('final(points.B)', 'norm(points.B)'),
        ('final(body_poses.crank)', 'expected body_poses.crank.x'),  # m beside rad
        ('final(diagnostics.distance)', 'has no derivative'),
        (3, 'not a number of a run'),
        ('maxx(energy)', "of: no such number of a run, got 'maxx'; did you mean 'max'?"),
        ('max(energy', "nothing closes the '(' behind 'max', got 'max(energy'; expected 'max(e"),
    ):
        assert told in refused(simulation, of, ['m'], duration=0.1)
    for source in (None, 3, [simulation]):
        assert 'source: no run' in refused(source, OBSERVED[0], ['m'], duration=0.1)
    assert 'how long' in refused(simulation, OBSERVED[0], ['m'])
    assert 'no list of names' in refused(simulation, OBSERVED[0], 'm', duration=0.1)
    for name, told in (
        ('gravity.acceleration.y', 'by.gravity.acceleration.y: no such place in a list'),
        ('solver.step', 'by: no tangent by a number of the solver'),
    ):
        assert refused(simulation, OBSERVED[0], [name], duration=0.1).startswith(told)
    made = gradient(robot, OBSERVED[0], ['m'], duration=0.01)
    assert made == gradient(simulation, OBSERVED[0], ['m'], duration=0.01)
    simulation.step(10)
    for name in ('a', 'initial.velocities.A.0'):
        told = refused(simulation, OBSERVED[0], [name], duration=0.1)
        assert 'does not begin where its scene begins' in told


def test_masses_of_a_run_from_another_state() -> None:
    """The state is given there, and masses change the motion from it."""
    scene = load_scene('slider_crank')
    simulation = Simulation(scene)
    simulation.step(50)
    state = simulation.state

    def end(mass: float) -> float:
        other = Simulation(overrides.with_changes(scene, {'coupler.mass': repr(mass)}))
        other.restore(state)
        other.step(200)
        return float(other.sample().points['B'][0])

    name = 'coupler.mass'
    found = gradient(simulation, 'final(points.B.x)', [name], duration=200 * simulation.h)
    difference = (8 * (end(1.001) - end(0.999)) - (end(1.002) - end(0.998))) / 0.012
    assert found.by[name] == pytest.approx(difference, rel=1e-8)
    assert 'by no number' in refused(simulation, 'final(points.B.x)', [], duration=0.1)


def test_reactions_beside_a_singular_position() -> None:
    """At each step through the position, also a thousandth of the size beside it."""
    scene = overrides.with_changes(load_scene('slider_crank'), {'solver.integrator': 'dop853'})
    duration, of = 0.42, 'rms(norm(crank_pin.force))'

    def size(mass: float) -> float:
        run = Simulation(overrides.with_changes(scene, {'coupler.mass': repr(mass)}))
        samples = list(run.run(duration))
        forces = [np.linalg.norm(each.reactions['crank_pin'].force) for each in samples]
        times = np.array([each.t for each in samples])
        return FOLDS['rms'](times, np.array(forces)).value

    found = gradient(Simulation(scene), of, ['coupler.mass'], duration=duration)
    difference = (8 * (size(1.001) - size(0.999)) - (size(1.002) - size(0.998))) / 0.012
    assert found.by['coupler.mass'] == pytest.approx(difference, rel=1e-6)


def test_a_long_run_needs_no_square_of_its_samples() -> None:
    """They are so many that their square would not fit into any memory."""
    t = np.linspace(0.0, 400.0, 400_001)
    for fold, exact in (
        ('integral', 1.0 - np.cos(400.0)),
        ('mean', (1.0 - np.cos(400.0)) / 400.0),
        ('rms', np.sqrt(0.5 - np.sin(800.0) / 1600.0)),
    ):
        found = FOLDS[fold](t, np.sin(t))
        assert found.value == pytest.approx(exact, abs=1e-10)
        assert found.weights.shape == t.shape


def test_a_length_that_unfolds_a_position_is_refused_behind_it() -> None:
    name, of = 'mechanism.points.A.at.0', 'final(points.B.x)'
    simulation = Simulation(load_scene('slider_crank'))
    assert np.isfinite(gradient(simulation, of, [name], duration=0.3).by[name])
    assert 'unfolds the singular position' in refused(simulation, of, [name], duration=0.5)


def test_friction_under_reactions_is_refused() -> None:
    scene = overrides.with_changes(
        load_scene('slider_crank'), {'effects.joint_friction': '{joint: knee, dynamic: 0.1}'}
    )
    assert 'joint_friction' in refused(Simulation(scene), 'final(points.B.x)', ['m'], duration=0.1)


def test_the_steps_keep_their_bits(robot: Scene) -> None:
    simulation = Simulation(robot, **ADAPTIVE)
    follower = AdjointFollowing(simulation._run.stepper, simulation.model)
    follower.provide(1000)
    simulation._write_down(follower, 5)
    other = Simulation(robot, **ADAPTIVE)
    other.step(5)
    assert simulation.state.q.tobytes() == other.state.q.tobytes()


def test_steps_that_are_too_long_are_told() -> None:
    """At 20 ms the derivative is off by 4 %."""
    for step, told in ((2e-3, ''), (2e-2, 'steps of 0.02 s are too long')):
        simulation = Simulation(load_scene('slider_crank'), step=step, integrator='rk4')
        found = gradient(simulation, 'final(points.B.x)', ['crank.mass'], duration=2.0)
        assert found.trouble[: len(told)] == told and bool(found.trouble) == bool(told)


@pytest.mark.parametrize(
    ('of', 'fine', 'coarse'),
    [('max(norm(crank_pin.force))', 5, 100), ('rms(knee.velocity)', 5, 100)],
)
def test_samples_that_are_too_far_apart_are_told(of: str, fine: int, coarse: int) -> None:
    """The largest force was off by 7 %, without a word."""
    simulation = Simulation(load_scene('slider_crank'))
    exact = gradient(simulation, of, ['m'], duration=2.0, every=4).value
    for every, told in ((fine, False), (coarse, True)):
        found = gradient(simulation, of, ['m'], duration=2.0, every=every)
        assert ('samples are too far apart for it' in found.trouble) == told
        assert (abs(found.value / exact - 1.0) > 1e-3) == told


@pytest.mark.parametrize('of', ['mean(energy)', 'rms(energy)', 'max(energy)'])
def test_an_energy_that_stays_zero_needs_no_closer_samples(of: str) -> None:
    """A pendulum that is let go at the height of its pivot has no energy but rounding, with any
    gravity."""
    simulation = Simulation(load_scene('pendulum'))
    found = gradient(simulation, of, ['gravity.acceleration.1'], duration=1.0, every=10)
    assert abs(found.value) < 1e-12 and not found.trouble
    if of == 'mean(energy)':
        assert found.by['gravity.acceleration.1'] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('settings', [{}, {'integrator': 'dop853_adaptive'}])
def test_a_sample_at_a_kink_over_time_is_of_its_instant(settings: dict[str, Any]) -> None:
    """A step ends just before a row of a table. The state of the next step was taken for it."""
    scene = {
        'mechanism': {
            'alf': 1,
            'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
            'bodies': {'arm': {'points': ['O', 'A'], 'mass': 3.0, 'inertia': 'rod'}},
            'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'arm'], 'at': 'O'}},
        },
        # the moment of inertia about the pin is 1, so that the rate is 5 t²/2, later t - 0.1
        'effects': {'user_table': {'joint': 'pin', 'table': [[0, 0], [0.2, 1], [9, 1]]}},
    }
    simulation = Simulation(load_scene(scene), step=1e-2, **settings)
    # a row at the end of the run is as good
    for of, duration, expected in (('mean', 0.4, 7 / 60), ('final', 0.2, 0.1)):
        found = gradient(simulation, f'{of}(pin.velocity)', ['arm.mass'], duration)
        assert found.value == pytest.approx(expected, rel=1e-9)
        assert found.by['arm.mass'] == pytest.approx(-expected / 3.0, rel=1e-9)


def servo(velocity_gain: float) -> Scene:
    table = [[0, 0], [0.3, 0.6], [0.8, 0.2]]
    gains = {'position_gain': 30, 'velocity_gain': velocity_gain}
    effects = {'motor': {'servo': {'joint': 'pin', 'position': table, **gains}}}
    return load_scene({**ARM, 'effects': effects, 'solver': {'accuracy': 1e-6}})


def test_an_instant_at_which_a_force_jumps_has_no_derivative() -> None:
    """With a velocity gain the motor's effort jumps at a row of its table."""
    name = 'servo.position.1.0'
    assert gradient(servo(0.0), 'final(pin.position)', [name], duration=0.5).by[name] != 0.0
    with pytest.raises(InputError, match=r'a force jumps at t = 0.3 s, which moves with it'):
        gradient(servo(2.0), 'final(pin.position)', [name], duration=0.5)


def test_a_jump_that_a_limit_hides_at_the_start_has_no_derivative() -> None:
    """At the start the motor is at its limit, on both sides of the row; at the row it is not."""
    name, motor = 'motor.position.1.0', {'joint': 'pin', 'limit': 3, 'position_gain': 20}
    motor['position'] = [[0, 0.5], [0.2, 0.5], [0.3, 0.7]]
    bar = {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'}
    mechanism = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'bar': bar},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
    }
    damped = {**motor, 'velocity_gain': 5}

    def scene(motor: dict[str, Any]) -> Scene:
        return load_scene({'mechanism': mechanism, 'effects': {'motor': motor}})

    def turned(change: float) -> float:
        run = Simulation(overrides.with_changes(scene(damped), {name: repr(0.2 + change)}))
        run.step(250)
        return float(run.sample().joint_positions[0])

    assert abs(turned(1e-3) - turned(-1e-3)) > 1e-4
    with pytest.raises(InputError, match=r'a force jumps at t = 0.2 s, which moves with it'):
        gradient(scene(damped), 'final(pin.position)', [name], duration=0.25)
    soft = scene({**motor, 'position_gain': 5})
    assert gradient(soft, 'final(pin.position)', [name], duration=0.5).by[name] < 0.0


def test_an_accuracy_picks_an_explicit_integrator() -> None:
    """Where it would pick the implicit one for the motion alone."""
    assert Simulation(servo(2.0)).solver.integrator == 'esdirk43_adaptive'
    name = 'servo.position_gain'
    followed = Simulation(servo(2.0), tangents=[name])
    followed.step(round(0.5 / followed.h))
    tangent = followed.sample().tangents[name].joints['pin'].position
    found = gradient(servo(2.0), 'final(pin.position)', [name], duration=0.5)
    assert found.by[name] == pytest.approx(tangent, rel=1e-12)


@pytest.mark.thorough
def test_an_energy_beside_a_contact_that_begins() -> None:
    """The heel of the leg stands on its spring of exponent 1.5, close to the place at which it
    leaves: differences across this place are off by a thousandth."""
    settings = {'solver.integrator': 'esdirk43_adaptive', 'solver.tolerance': '1e-7'}
    scene = overrides.with_changes(load_scene('spring_leg'), settings)
    name, of = 'effects.motor.toe_drive.position.1.1', 'final(energy)'
    followed = Simulation(scene, tangents=[name])
    followed.step(60)
    tangent = followed.sample().tangents[name].of('energy')
    found = gradient(Simulation(scene), of, [name], duration=60 * followed.h).by[name]
    assert found == pytest.approx(tangent, rel=1e-8)


def test_what_a_command_calls_by_is_named_so(robot: Scene) -> None:
    for by, key in ((['mass'], 'by'), (['m', 'm'], 'by.1')):
        with pytest.raises(InputError) as caught:
            gradient(robot, 'final(energy)', by, duration=0.01)
        assert str(caught.value.key).startswith(key)
    with pytest.raises(InputError, match='every: longer than the run, got 1000'):
        gradient(robot, 'final(energy)', ['m'], duration=0.01, every=1000)

"""Tangents: against exact derivatives of mechanisms with one freedom, and against properties that
every motion has."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, gradient, kernel, load_scene
from alf_ros.errors import InputError
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sample_tangents import MotionTangent
from alf_ros.studies.exact.exact_tangents import ExactTangents, double_four_bar, slider_crank
from support.some_scenes import SOME_SCENES
from support.tangent_robot import GROUPS, NUMBERS, ROBOT
from support.thorough import combined, thinned

FIXED = {'step': 1e-2 / 7.0}
ADAPTIVE = {'step': 0.1, 'integrator': 'dop853_adaptive', 'tolerance': 1e-8}
SHARP = {**ADAPTIVE, 'tolerance': 1e-11}


def errors(exact: ExactTangents, **settings: Any) -> tuple[float, dict[str, float]]:
    """The largest error of positions and the largest error of each tangent, both in parts of the
    largest value."""
    sim = Simulation(load_scene(exact.scene), tangents=exact.names, **settings)
    samples = list(sim.run(exact.times[-1], at=list(exact.times)))
    motion = np.array([each.q for each in samples])
    position = np.abs(motion - exact.q).max() / np.abs(exact.q).max()
    found = {}
    for name, expected in zip(exact.names, exact.dq, strict=True):
        tangent = np.array([each.tangents[name].q for each in samples])
        found[name] = float(np.abs(tangent - expected).max() / np.abs(expected).max())
    return float(position), found


SETTINGS = [
    pytest.param(FIXED, id='fixed'),
    pytest.param(ADAPTIVE, id='adaptive'),
    pytest.param(SHARP, id='sharp'),
]
SOLUTIONS = [
    pytest.param(slider_crank, id='slider_crank'),
    pytest.param(double_four_bar, id='double_four_bar'),
]


@pytest.mark.parametrize(('settings', 'solution'), combined(SETTINGS, SOLUTIONS))
def test_exact_through_singular_passes(solution: Any, settings: dict[str, Any]) -> None:
    """10 s and 11 or 10 passes: the tangents are as good as the motion, or 100 times less."""
    position, tangents = errors(solution(10.0), **settings)
    assert position < 1e-7
    for name, error in tangents.items():
        assert error <= 100.0 * position + 1e-11, name


def test_masses_through_singular_passes() -> None:
    """A mass that changes feels q̈ across the branch as well: as good as other numbers."""
    position, tangents = errors(double_four_bar(10.0), step=1e-2, integrator='dop853')
    assert position < 1e-12
    for name, error in tangents.items():
        assert error < 3e-10, name


@pytest.mark.parametrize('step', thinned([1e-2 / 3.0, 1e-2], keep=[1e-2]))
def test_steps_along_arcs_through_singular_passes(step: float) -> None:
    """Bars turn by up to 0.06 rad in a step: the tangents are as good as the motion, or 20 times
    less."""
    position, tangents = errors(slider_crank(10.0), step=step)
    for name, error in tangents.items():
        assert error <= 20.0 * position, name


def test_order_of_convergence() -> None:
    """The error falls with the fourth power of the step, like the error of rk4."""
    exact = slider_crank(1.0)
    coarse, fine = (errors(exact, step=h)[1] for h in (1e-2, 5e-3))
    for name in exact.names:
        assert 3.5 < math.log2(coarse[name] / fine[name]) < 6.5, name


@pytest.mark.parametrize('settings', [FIXED, ADAPTIVE], ids=['fixed', 'adaptive'])
def test_the_run_keeps_its_bits(settings: dict[str, Any]) -> None:
    scene = load_scene('slider_crank')
    plain, followed = Simulation(scene, **settings), Simulation(scene, tangents=['m'], **settings)
    for each in (plain, followed):
        each.step(20)
    assert plain.state.q.tobytes() == followed.state.q.tobytes()
    assert plain.state.qd.tobytes() == followed.state.qd.tobytes()
    assert plain.evaluations == followed.evaluations


# ------------------------------------------------------------- every mechanism of the library


def autonomous(name: str) -> Scene | None:
    """The scene with a parameter that nothing depends on; None if time occurs in it."""
    scene = load_scene(name)
    timed = any(effect.kind in ('motor', 'user_table') for effect in scene.effects)
    if scene.mechanism.drives or timed or 'parameters:' not in scene.text:
        return None
    return overrides.with_changes(scene, {'mechanism.parameters.unused': '1.0'})


def accelerated(sample: Sample) -> np.ndarray[Any, Any]:
    """q̇ and q̈ (2, blocks D)."""
    return np.array([sample.state.qd, sample._accelerated[0].qdd])


@pytest.mark.parametrize('name', SOME_SCENES)
def test_derivative_by_the_start_of_time(name: str) -> None:
    """Started later by δ, a motion is later by δ: its derivative is q̇, q̈. All rows, spaces and
    effects of the library take part."""
    scene = autonomous(name)
    if scene is None:
        return
    try:
        sim = Simulation(scene, tangents=['unused'])
    except InputError as error:
        assert 'singular position' in str(error) or 'depends on reactions' in str(error)
        return
    assert not sim.state.tangents.any()
    start = accelerated(sim.sample())
    sim.restore(_with_tangents(sim, start))
    sim.step(100)
    end = accelerated(sim.sample())
    found = sim.state.tangents.reshape(2, -1)
    for got, expected in zip(found, end, strict=True):
        assert np.abs(got - expected).max() <= 1e-6 * max(np.abs(end).max(), 1e-3)


def _with_tangents(sim: Simulation, values: Any) -> Any:
    state = copy.copy(sim.state)
    object.__setattr__(state, 'tangents', np.ascontiguousarray(values).ravel())
    return state


# ---------------------------------------------------------- all kinds of numbers of a scene


@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = Path(tmp_path_factory.mktemp('robot')) / 'robot.yaml'
    path.write_text(ROBOT, 'utf-8')
    return load_scene(path)


@pytest.fixture(scope='module')
def tangents(robot: Scene) -> dict[str, MotionTangent]:
    found: dict[str, MotionTangent] = {}
    for names in GROUPS:
        sim = Simulation(robot, tangents=names)
        sim.apply_wrench('rocker', force=[1.0, 2.0], torque=0.3)
        sim.step(200)
        found.update(sim.sample().tangents)
    return found


def read(sample: Sample) -> np.ndarray[Any, Any]:
    points = np.concatenate([sample.points[name] for name in sample.points])
    joints = [sample.joint_positions, sample.joint_velocities]
    return np.concatenate([sample.q, sample.qd, points, *joints])


def difference(
    scene: Scene,
    name: str,
    size: float,
    read: Callable[[Scene], np.ndarray[Any, Any]],
) -> np.ndarray[Any, Any]:
    """The derivative of what `read` finds, by a number that changes by a part `size`: a difference
    of sixth order."""
    value = overrides.number(scene, name)
    step = size * (abs(value) or 1.0)

    def other(change: float) -> np.ndarray[Any, Any]:
        return read(overrides.with_changes(scene, {name: repr(value + change)}))

    weights = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
    terms = [w / step * (other(k * step) - other(-k * step)) for k, w in enumerate(weights, 1)]
    return np.sum(terms, axis=0)


@pytest.mark.parametrize('name', NUMBERS)
def test_numbers_of_a_scene(robot: Scene, tangents: dict[str, MotionTangent], name: str) -> None:
    def other(scene: Scene) -> np.ndarray[Any, Any]:
        sim = Simulation(scene)
        sim.apply_wrench('rocker', force=[1.0, 2.0], torque=0.3)
        sim.step(200)
        return read(sim.sample())

    expected = difference(robot, name, 1e-2, other)
    tangent = tangents[name]
    points = np.concatenate([tangent.points[point] for point in tangent.points])
    joints = [tangent.joint_positions, tangent.joint_velocities]
    found = np.concatenate([tangent.q, tangent.qd, points, *joints])
    assert np.abs(expected).max() > 1e-6
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-8 * np.abs(expected).max())
    assert tangent.joints['knee'].position == tangent.joint_positions[1]


# steps in which bars turn by more than 0.01 rad, so that they are added up along arcs
COARSE = [
    pytest.param({'step': 1e-2, 'integrator': 'rk4'}, id='rk4'),
    pytest.param({'step': 3e-2, 'integrator': 'dop853'}, id='dop853'),
]


def after(scene: Scene, steps: int, **settings: Any) -> np.ndarray[Any, Any]:
    """q and q̇ after some steps."""
    sim = Simulation(scene, **settings)
    sim.step(steps)
    return np.concatenate([sim.sample().q, sim.sample().qd])


@pytest.mark.parametrize('settings', COARSE)
@pytest.mark.parametrize(
    'name', ['L', 'crank.mass', 'gravity.acceleration.1', 'initial.velocities.B.0']
)
def test_steps_along_arcs_have_their_derivative(name: str, settings: dict[str, Any]) -> None:
    """Nearly to rounding: arcs of equal bars hardly leave Φ = 0, so no stage is moved onto it."""
    scene = load_scene('slider_crank')
    sim = Simulation(scene, tangents=[name], **settings)
    sim.step(12)
    expected = difference(scene, name, 3e-3, lambda each: after(each, 12, **settings))
    tangent = sim.sample().tangents[name]
    found = np.concatenate([tangent.q, tangent.qd])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.fixture(scope='module')
def fast(robot: Scene) -> Scene:
    return overrides.with_changes(robot, {'initial.velocities.A.0': '8.0'})


@pytest.fixture(scope='module')
def along_arcs(fast: Scene) -> dict[str, MotionTangent]:
    found: dict[str, MotionTangent] = {}
    for names in GROUPS:
        sim = Simulation(fast, tangents=names, step=1e-2, integrator='rk4')
        sim.step(8)
        found.update(sim.sample().tangents)
    return found


@pytest.mark.parametrize('name', thinned(NUMBERS, keep=NUMBERS[::2]))
def test_numbers_along_arcs(fast: Scene, along_arcs: dict[str, MotionTangent], name: str) -> None:
    """A loop that quadratic rows close moves stages: how this way changes is left out."""
    expected = difference(
        fast, name, 3e-3, lambda each: after(each, 8, step=1e-2, integrator='rk4')
    )
    tangent = along_arcs[name]
    found = np.concatenate([tangent.q, tangent.qd])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


DRIVEN = """
mechanism:
  alf: 1
  space: planar
  parameters: {a: 1.0, b: 0.8, m: 1.0, w: 3.0}
  points:
    O: {at: [0, 0], fixed: true}
    A: {at: [a, 0]}
    B: {at: [a, b]}
  bodies:
    upper: {points: [O, A], mass: m, inertia: rod}
    lower: {points: [A, B], mass: m, inertia: {about_com: 0.1}, com: [0.3, 0.1]}
  joints:
    shoulder: {type: revolute, between: [ground, upper], at: O}
    elbow: {type: revolute, between: [upper, lower], at: A}
  drives:
    swing: {joint: shoulder, angle: 0.5*sin(w*t)}
effects: {gravity: {acceleration: [0, -9.81]}}
solver: {step: 1.0e-3}
"""


FAST = {
    '0.5*sin(w*t)': 'w*t + 0.1*sin(5*t)',
    'solver:': 'initial: {velocities: {B: [-5, ~]}}\nsolver:',
}


@pytest.mark.parametrize(
    ('step', 'integrator', 'steps', 'changes'),
    [(1e-3, 'rk4', 300, {}), (2e-2, 'dop853', 5, FAST)],
    ids=['', 'along_arcs'],
)
@pytest.mark.parametrize('name', ['b', 'w', 'lower.com.0', 'lower.inertia.about_com'])
def test_beside_a_drive(
    name: str, step: float, integrator: str, steps: int, changes: dict[str, str], tmp_path: Path
) -> None:
    path, text = tmp_path / 'driven.yaml', DRIVEN
    for old, new in changes.items():
        text = text.replace(old, new)
    path.write_text(text, 'utf-8')
    scene = load_scene(path)
    settings: dict[str, Any] = {'step': step, 'integrator': integrator}
    sim = Simulation(scene, tangents=[name], **settings)
    sim.step(steps)

    def other(changed: Scene) -> np.ndarray[Any, Any]:
        run = Simulation(changed, **settings)
        run.step(steps)
        return run.sample().q

    expected = difference(scene, name, 3e-3, other)
    assert np.abs(expected).max() > 1e-2
    found = sim.sample().tangents[name].q
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


# ------------------------------------------------------------------------ states and copies


def test_copies_and_states_continue_bit_for_bit(robot: Scene) -> None:
    sim = Simulation(robot, tangents=GROUPS[0])
    sim.step(20)
    state, others = sim.state, [copy.copy(sim), pickle.loads(pickle.dumps(sim))]
    sim.step(20)
    expected = sim.state.tangents.tobytes()
    sim.restore(state)
    sim.step(20)
    for each in others:
        each.step(20)
    for each in (sim, *others):
        assert each.state.tangents.tobytes() == expected
    sim.reset()
    assert (
        sim.state.tangents.tobytes()
        == Simulation(robot, tangents=GROUPS[0]).state.tangents.tobytes()
    )


@pytest.mark.thorough
@pytest.mark.parametrize('windows', thinned([0, 7], keep=[7]))
def test_more_lanes(windows: int) -> None:
    """9 to 12 parameters share twelve lanes, 13 to 16 two registers, 17 two groups of that. Each
    number of lanes has compiled code; here one effect, as each effect has such code too. Runs with
    few parameters find the same tangents."""
    scene = load_scene('slider_crank')
    lengths = [f'mechanism.points.{name}' for name in ('O.at.0', 'A.at.1', 'B.at.0')]
    loads = [f'gravity.acceleration.{axis}' for axis in (0, 1)]
    names = ['m', 'L', 'crank.mass', 'coupler.mass', 'initial.velocities.B.0', *lengths, *loads]
    names += [f'joints.crank_pin.effort[{10 * k}:{10 * k + 10}]' for k in range(windows)]
    assert len(names) in (10, 17)
    Simulation(scene).step()
    code = len(kernel.advance.signatures)
    parts = (names, names[:5], names[5:10], *([names[10:]] if windows else []))
    runs = [Simulation(scene, tangents=some) for some in parts]
    for run in runs:
        run.step(100)
    assert len(kernel.advance.signatures) == code
    together, *few = [run.sample().tangents for run in runs]
    for name in names:
        expected = next(each[name] for each in few if name in each)
        size = np.abs(expected.q).max()
        np.testing.assert_allclose(together[name].q, expected.q, rtol=0, atol=1e-12 * size)


def test_the_energy_keeps_its_derivative() -> None:
    """The total energy stays, also behind singular positions: so does its derivative."""
    names = ['coupler.mass', 'gravity.acceleration.1', 'initial.velocities.B.0', 'L']
    simulation = Simulation(load_scene('slider_crank'), step=1e-3, tangents=names)
    first = {name: simulation.sample().tangents[name].of('energy') for name in names}
    simulation.step(700)
    sample = simulation.sample()
    for name in names:
        assert sample.tangents[name].of('energy') == pytest.approx(first[name], rel=1e-8)
        kinetic = sample.tangents[name].of('kinetic_energy')
        assert abs(float(kinetic) - float(first[name])) > 0.1


def test_reactions_by_a_mass() -> None:
    """A pendulum of any mass moves alike, and its bearing force is in proportion."""
    simulation = Simulation(load_scene('pendulum'), tangents=['bar.mass'])
    simulation.step(100)
    sample = simulation.sample()
    (joint,) = sample.reactions
    expected = sample.reactions[joint].force / float(simulation.scene.mechanism.bodies[0].mass)
    found = sample.tangents['bar.mass'].of(f'{joint}.force')
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    copied = pickle.loads(pickle.dumps(sample))
    np.testing.assert_array_equal(copied.tangents['bar.mass'].of(f'{joint}.force'), found)


@pytest.mark.parametrize('name', ['m', 'a', 'pull.stiffness', 'initial.velocities.A.0'])
def test_quantities_under_inputs(robot: Scene, name: str) -> None:
    """Reactions and efforts, against differences of sixth order of runs with other numbers."""

    def run(scene: Scene, **settings: Any) -> Sample:
        simulation = Simulation(scene, **settings)
        simulation.apply_wrench('rocker', force=[1.0, 2.0], torque=0.3)
        simulation.apply_effort('wrist', 0.4)
        simulation.step(100)
        return simulation.sample()

    tangent = run(robot, tangents=[name]).tangents[name]
    value, weights = overrides.number(robot, name), (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
    size, slopes = 1e-3 * value, np.zeros(3)
    for k, w in enumerate(weights, 1):
        for sign in (1.0, -1.0):
            changed = {name: repr(value + sign * k * size)}
            beside = run(overrides.with_changes(robot, changed))
            reading = [*beside.reactions['knee'].force, beside.joints['pin'].effort]
            slopes += sign * w / size * np.array(reading)
    found = np.append(tangent.of('knee.force'), tangent.of('pin.effort'))
    np.testing.assert_allclose(found, slopes, rtol=1e-6, atol=1e-8)


def test_quantities_without_a_derivative(robot: Scene) -> None:
    simulation = Simulation(robot, tangents=['m'], ledger=True)
    tangent = simulation.sample().tangents['m']
    refused: list[tuple[Any, str]] = [
        ('works.drag.air', 'has no derivative'),
        ('nee.force', 'no such quantity'),
        (3, 'no name'),
    ]
    for quantity, told in refused:
        with pytest.raises(InputError, match=told):
            tangent.of(quantity)


def test_instants_between_steps(robot: Scene) -> None:
    sim = Simulation(robot, tangents=['m'], step=2e-3)
    (between,) = (s for s in sim.run(0.1, at=[0.0505]))
    fine = Simulation(robot, tangents=['m'], step=5e-4)
    fine.step(101)
    found, expected = between.tangents['m'].q, fine.sample().tangents['m'].q
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


# ------------------------------------------------------------------------------- refusals


def refused(scene: Scene, names: Sequence[str], **settings: Any) -> str:
    with pytest.raises(InputError) as caught:
        Simulation(scene, tangents=names, **settings)
    text = str(caught.value)
    assert '\n' not in text
    return text


@pytest.mark.parametrize(
    ('names', 'told'),
    [
        ('m', 'no list of names'),
        (['m', 'm'], 'named twice'),
        (['nothing'], 'nothing of this name'),
        (['coupler'], "tangents: not one value, got 'coupler'; did you mean 'coupler.mass'?"),
        (['gravity'], 'known: gravity.acceleration.0, gravity.acceleration.1'),
        (['mechanism'], 'expected mechanism.parameters.L'),
        (['crank.inertia'], "tangents.crank.inertia: not a number, got 'rod'"),
        (['mechanism.bodies.coupler'], 'expected mechanism.bodies.coupler.mass'),
        (
            ['gravity.acceleration'],
            "not one number, got 'a list'; expected gravity.acceleration.0",
        ),
        (
            ['gravity.acceleration.7'],
            "tangents.gravity.acceleration.7: no such place in a list, got '7'; expected 0 to 1",
        ),
        (['gravity.acceleration.y'], "no such place in a list, got 'y'; expected 1 for y"),
        (['gravity.acceleration.z'], "no such place in a list, got 'z'; expected 0 to 1"),
        (['coupler.mass.x'], "tangents.coupler.mass.x: a single value has no parts, got 'x'"),
        (['solver.step'], 'no tangent by a number of the solver'),
        ([''], 'no name'),
    ],
)
def test_names_are_refused(names: Any, told: str) -> None:
    assert told in refused(load_scene('slider_crank'), names)


def test_only_a_simulation_is_like_another() -> None:
    for names in ((), ('coupler.mass',)):
        with pytest.raises(InputError, match='like: not a simulation'):
            Simulation(load_scene('slider_crank'), tangents=names, like='x')  # type: ignore[arg-type]


def test_settings_are_refused() -> None:
    scene = load_scene('slider_crank')
    assert 'alf2 alone' in refused(scene, ['m'], formulation='canonical')


def test_friction_under_reactions_is_refused() -> None:
    scene = overrides.with_changes(
        load_scene('slider_crank'), {'effects.joint_friction': '{joint: knee, dynamic: 0.1}'}
    )
    assert 'joint_friction' in refused(scene, ['m'])


def test_a_number_with_a_kink_is_refused() -> None:
    scene = overrides.with_changes(
        load_scene('slider_crank'), {'effects.damper': '{between: [A, O], damping: 0}'}
    )
    assert 'the scene is refused' in refused(scene, ['damper.damping'])


@pytest.mark.parametrize('name', ['L', 'mechanism.points.A.at.0'])
def test_a_quantity_that_is_zero_has_a_derivative(name: str) -> None:
    """A spring of the length that is drawn stores nothing, but for rounding."""
    spring = '{between: [A, ground], at: [~, [0.3, 1.7]], stiffness: 40}'
    scene = overrides.with_changes(load_scene('slider_crank'), {'effects.spring': spring})
    tangent = Simulation(scene, tangents=[name]).sample().tangents[name]
    assert np.abs(tangent.of('stored.spring')) < 1e-20


@pytest.mark.parametrize('name', ['bar.mass', 'gravity.acceleration.1'])
def test_an_energy_that_is_zero_has_a_derivative(name: str) -> None:
    """A pendulum released from the height of its pin keeps the energy 0. Its kinetic energy, 10 J
    at the bottom, rounds beside it."""
    scene = load_scene('pendulum')
    simulation = Simulation(scene, tangents=[name])
    (sample,) = simulation.run(0.6, at=[0.6])
    assert sample.kinetic_energy > 9.0
    assert np.abs(sample.tangents[name].of('energy')) < 1e-10
    assert abs(gradient(Simulation(scene), 'final(energy)', [name], duration=0.6).by[name]) < 1e-10


def test_a_point_that_leaves_the_plane_of_a_plate() -> None:
    """The plate of a delta robot lies in a plane, with a direction across it; further away from
    the plane the point C does without. The plate only shifts, so the height of its centre of mass
    moves nothing but C. Beside the drawing one scene was of another form: an IndexError."""
    name = 'mechanism.points.C.at.2'
    simulation = Simulation(load_scene('delta_robot'), tangents=[name])
    simulation.step(20)
    tangent = simulation.sample().tangents[name]
    assert tangent.points['C'] == pytest.approx([0.0, 0.0, 1.0], abs=1e-10)
    assert np.abs(tangent.points['Q0']).max() < 1e-10
    assert np.abs(tangent.joint_velocities).max() < 1e-9


def test_a_start_in_a_singular_position_is_refused() -> None:
    scene = overrides.with_changes(
        load_scene('slider_crank'),
        {'initial': '{positions: {A: [0, 1], B: [0, 0]}, velocities: {B: [1, 0]}}'},
    )
    assert 'starts in a singular position' in refused(scene, ['m'])


def test_a_length_that_unfolds_a_position_is_refused_behind_it() -> None:
    """Both lengths together leave the position as it is; one alone makes another mechanism."""
    names = ['L', 'mechanism.points.A.at.0']
    sim = Simulation(load_scene('slider_crank'), tangents=names)
    sim.step(300)
    assert np.isfinite(sim.sample().tangents[names[1]].q).all()
    sim.step(200)  # 0.39 s: the position
    tangents = sim.sample().tangents
    assert np.isfinite(tangents['L'].q).all()
    with pytest.raises(InputError, match=r'A.at.0: .* unfolds .* t = 0.391732 s'):
        tangents[names[1]]
    later = sim.state
    sim.reset()
    assert np.isfinite(sim.sample().tangents[names[1]].q).all()
    assert later.step == 500


def test_a_body_cannot_be_placed(robot: Scene) -> None:
    sim = Simulation(robot, tangents=['m'])
    with pytest.raises(InputError, match='placed body'):
        sim.place('crank', twist=[0.0, 0.0, 1.0])


def test_a_state_without_tangents_is_refused(robot: Scene) -> None:
    sim = Simulation(robot, tangents=['m'])
    with pytest.raises(InputError, match=r'state\.tangents'):
        sim.restore(Simulation(robot).state)


@pytest.mark.parametrize('integrator', ['rk4', 'esdirk43'])
def test_all_runs_share_the_code_of_their_steps(robot: Scene, integrator: str) -> None:
    """Whatever follows them or writes them down; else each would compile the steps again."""
    settings: dict[str, Any] = {'integrator': integrator}
    Simulation(robot, **settings).step()
    steps = {'rk4': kernel.advance, 'esdirk43': kernel.advance_implicitly}[integrator]
    before = len(steps.signatures)
    assert before > 0
    Simulation(robot, tangents=NUMBERS[:1], **settings).step()
    gradient(Simulation(robot, **settings), 'final(points.B.x)', NUMBERS[:1], duration=0.01)
    assert len(steps.signatures) == before


def test_nobody_asked() -> None:
    with pytest.raises(InputError, match='no tangents follow'):
        len(Simulation(load_scene('slider_crank')).sample().tangents)


@pytest.mark.parametrize('length', [0.67, 0.72])
def test_a_drawing_that_does_not_close(length: float) -> None:
    """Its closed start moves with every number, but for rounding smoothly."""
    rocker = {'points': ['C', 'B'], 'mass': 0.4, 'inertia': 'rod', 'length': length}
    scene = load_scene(
        {
            'mechanism': {
                'alf': 1,
                'space': 'planar',
                'parameters': {'m': 1.3},
                'points': {
                    'O': {'at': [0, 0], 'fixed': True},
                    'C': {'at': [0.83, -0.11], 'fixed': True},
                    'A': {'at': [0.1, 0.31]},
                    'B': {'at': [0.9, 0.55]},
                },
                'bodies': {
                    'crank': {'points': ['O', 'A'], 'mass': 'm', 'inertia': 'rod'},
                    'coupler': {'points': ['A', 'B'], 'mass': 0.7, 'inertia': 'rod'},
                    'rocker': rocker,
                },
                'joints': {
                    'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
                    'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
                    'wrist': {'type': 'revolute', 'between': ['coupler', 'rocker'], 'at': 'B'},
                    'foot': {'type': 'revolute', 'between': ['ground', 'rocker'], 'at': 'C'},
                },
            },
            'effects': {'gravity': {'acceleration': [0, -9.81]}},
            'initial': {'velocities': {'A': [1.0, None]}},
            'solver': {'step': 1e-3, 'integrator': 'dop853_adaptive', 'tolerance': 1e-11},
        }
    )
    for name in ('m', 'coupler.mass', 'rocker.length', 'mechanism.points.C.at.1'):
        value, places = overrides.number(scene, name), []
        for sign in (1.0, -1.0):
            text = repr(value + sign * 1e-4)
            simulation = Simulation(overrides.with_changes(scene, {name: text}))
            simulation.step(200)
            places.append(simulation.sample().points['B'])
        simulation = Simulation(scene, tangents=[name])
        simulation.step(200)
        found = simulation.sample().tangents[name].points['B']
        assert found == pytest.approx((places[0] - places[1]) / 2e-4, rel=1e-4, abs=1e-6), name

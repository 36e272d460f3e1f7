"""Targets of motors and tendons as numbers that vary in a scene, by the names of inputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, ensemble, equilibrium_path, gradient, load_scene, optimise
from alf_ros.__main__ import main as program
from alf_ros.commands.fork import main as fork
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.scene import overrides
from alf_ros.scene.scene import Scene
from alf_ros.simulation import setup as settings
from support.log_files import make
from support.thorough import LONG, thinned

TARGET, SPEED = 'targets.rail.position', 'targets.rail.velocity'
MASS, STIFF, DAMPED = 2.5, 40.0, 8.0
SERVO: dict[str, Any] = {
    'joint': 'rail',
    'position': 0.1,
    'position_gain': STIFF,
    'velocity_gain': DAMPED,
}


def block(motor: Any) -> Scene:
    """A block on a rail, which a motor moves."""
    return moved_by({'motor': motor})


def moved_by(effects: Any) -> Scene:
    """The block under effects."""
    points = {'O': {'at': [0, 0], 'fixed': True}, 'P': {'at': [0, 0]}, 'R': {'at': [1, 0]}}
    rail = {'type': 'prismatic', 'between': ['ground', 'block'], 'at': 'P', 'axis': [1, 0]}
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'points': points,
        'bodies': {'block': {'points': ['P', 'R'], 'mass': MASS, 'inertia': 'rod'}},
        'joints': {'rail': rail},
    }
    return load_scene(
        {
            'name': 'block',
            'mechanism': mechanism,
            'effects': effects,
            'solver': {'step': 1e-3, 'integrator': 'dop853'},
        }
    )


def moved(target: float, speed: float, t: float) -> float:
    """m ẍ = k (x* - x) + c (ẋ* - ẋ) from rest at 0."""
    end, decay = target + DAMPED / STIFF * speed, DAMPED / (2.0 * MASS)
    turn = np.sqrt(STIFF / MASS - decay**2)
    shape = np.cos(turn * t) + decay / turn * np.sin(turn * t)
    return float(end * (1.0 - np.exp(-decay * t) * shape))


@pytest.mark.parametrize(
    'motor', thinned([{'servo': SERVO}, [SERVO], SERVO], keep=[{'servo': SERVO}, SERVO])
)
def test_members_follow_their_targets(motor: Any) -> None:
    """Of a motor with a name, in a list, and alone."""
    targets, speeds = [0.3, -0.5, 1.0], [0.0, 0.4, -0.2]
    found = ensemble(
        block(motor),
        {TARGET: targets, SPEED: speeds},
        sampling='table',
        outputs=['final(points.P.x)'],
        duration=0.5,
        workers=1 if LONG else 0,
    )
    wanted = [moved(x, v, 0.5) for x, v in zip(targets, speeds, strict=True)]
    np.testing.assert_allclose(found['final_points.P.x'], wanted, rtol=0, atol=1e-11)


def test_a_held_target_does_the_same() -> None:
    """The number of the scene moves the block as the same target from outside does."""
    scene = overrides.with_changes(block({'servo': SERVO}), {TARGET: '0.7'})
    held = Simulation(block({'servo': SERVO}))
    held.apply_target('rail', 0.7)
    of_scene = Simulation(scene, tangents=[TARGET, 'servo.position'])
    for each in (held, of_scene):
        each.step(400)
    assert held.state.q.tobytes() == of_scene.state.q.tobytes()
    for name in (TARGET, 'servo.position'):
        slope = of_scene.sample().tangents[name].points['P'][0]
        assert slope == pytest.approx(moved(1.0, 0.0, 0.4), rel=1e-10)
    found = gradient(scene, 'final(points.P.x)', [TARGET, f'{TARGET}[200:]'], duration=0.4)
    assert found.by[TARGET] == pytest.approx(moved(1.0, 0.0, 0.4), rel=1e-10)
    assert found.by[f'{TARGET}[200:]'] == pytest.approx(moved(1.0, 0.0, 0.2), rel=1e-10)


AIMED = {key: SERVO[key] for key in ('position', 'position_gain', 'velocity_gain')}
FOLLOWING: dict[str, dict[str, Any]] = {
    'a place': {'motor': {'servo': SERVO}},
    'a table of places': {'motor': {'servo': {**SERVO, 'position': [[0, 0], [1, 0.4]]}}},
    'a place and a rate': {'motor': {'servo': {**SERVO, 'velocity': 0.3}}},
    'a place, by a tendon': {'tendon': {'rail_belt': {**AIMED, 'joints': [['rail', 1]]}}},
}


@pytest.mark.parametrize('following', FOLLOWING)
@pytest.mark.parametrize('held', [False, True])
def test_a_rate_that_the_scene_does_not_give_has_a_derivative(following: str, held: bool) -> None:
    """The motor adds it to the slope of its position."""
    effects = FOLLOWING[following]
    name = 'targets.rail_belt' if 'tendon' in effects else 'targets.rail'
    speed, late = f'{name}.velocity', f'{name}.velocity[200:]'
    simulation = Simulation(moved_by(effects), tangents=[speed, late])
    if held:
        simulation.apply_target(name.removeprefix('targets.'), 0.7)
    state = simulation.state
    simulation.step(400)
    for each, t in ((speed, 0.4), (late, 0.2)):
        tangent = simulation.sample().tangents[each]
        shift, rate = tangent.joints['rail'].position, tangent.joints['rail'].velocity
        assert shift == pytest.approx(moved(0.0, 1.0, t), rel=1e-10)
        effort = tangent.of('joints.rail.effort')
        assert effort == pytest.approx(DAMPED - STIFF * shift - DAMPED * rate, rel=1e-8)
    simulation.restore(state)
    found = gradient(simulation, 'final(points.P.x)', [speed, late], duration=0.4)
    assert found.by[speed] == pytest.approx(moved(0.0, 1.0, 0.4), rel=1e-10)
    assert found.by[late] == pytest.approx(moved(0.0, 1.0, 0.2), rel=1e-10)


def test_a_tangent_is_by_the_target_that_is_held() -> None:
    """Which acts in place of the number of the scene."""
    simulation = Simulation(block({'servo': SERVO}), tangents=[TARGET, 'servo.position'])
    simulation.apply_target('rail', 0.7)
    simulation.step(400)
    tangents = simulation.sample().tangents
    assert tangents[TARGET].points['P'][0] == pytest.approx(moved(1.0, 0.0, 0.4), rel=1e-10)
    assert tangents['servo.position'].points['P'][0] == 0.0


def test_a_design_may_be_a_target() -> None:
    """The target with which a motor holds a slider-crank at rest, by an independent formula."""
    servo = {'joint': 'crank_pin', 'position': 1.0, 'position_gain': 30, 'velocity_gain': 1}
    effects = {'gravity': {'acceleration': [0, -9.81]}, 'motor': {'servo': servo}}
    scene = load_scene({'mechanism': 'slider_crank', 'effects': effects})
    name = 'targets.crank_pin.position'
    found = optimise(scene, {name: [0.5, 1.5]}, 'rms(crank_pin.velocity)', duration=0.1)
    # both rods of 1 kg and 1 m at 45 degrees: each centre of mass rises by cos 45 / 2 a radian
    assert found[name] == pytest.approx(np.pi / 4 + 9.81 * np.cos(np.pi / 4) / 30, rel=1e-4)


def test_a_path_adds_to_the_target() -> None:
    """`over` stays the number that is added to the target."""
    simulation = Simulation(block({'servo': SERVO}))
    path = equilibrium_path(simulation, over=TARGET, end=0.5)
    assert path.values[0] == 0.0
    np.testing.assert_allclose(path['points.P.x'], path.values + 0.1, rtol=0, atol=1e-9)


def test_a_fork_has_another_target(tmp_path: Path) -> None:
    (tmp_path / 'block.yaml').write_text(block({'servo': SERVO}).text, 'utf-8')
    log, _ = make(tmp_path / 'log', tmp_path / 'block.yaml', ticks=20)
    new = tmp_path / 'fork'
    assert program(['fork', str(log), '--at', '0', '--set', f'{TARGET}=2', '-o', str(new)]) == 0
    (made,) = new.rglob('*.mcap')
    (motor,) = load(made).scene(False).effects
    assert motor.parameters.position == 2.0


@pytest.mark.parametrize(
    ('held', 'refused'),
    [((0.7, None), {TARGET, SPEED}), ((0.7, 0.1), {TARGET, SPEED}), ((None, 0.1), {SPEED})],
)
def test_a_fork_in_which_a_target_is_held_is_refused(
    held: tuple[float | None, float | None], refused: set[str], tmp_path: Path
) -> None:
    """Since this one acts in place of the number of the scene. A position brings its slope, so
    that the velocity of the scene does not act beside it."""
    run = LogRun(tmp_path / 'log', settings.made(block({'servo': SERVO}), {}))
    simulation = run.setup.simulation
    run.send()
    simulation.apply_target('rail', *held)
    entry = {'kind': 'target', 'cause': 'command', 'name': 'rail'}
    run.note({**entry, 'position': held[0], 'velocity': held[1]})
    for _ in range(10):
        simulation.step(run.setup.steps)
        run.send()
    run.close()
    for name in (TARGET, SPEED):
        new = tmp_path / name
        given = [str(run.recorder.path), '--at', '0.02', '-o', str(new), '--set', f'{name}=2']
        if name in refused:
            with pytest.raises(InputError, match='--set: has no effect: a target from outside'):
                fork(given)
        else:
            assert fork(given) == 0


def test_the_target_of_a_tendon() -> None:
    """By its own name; one with the name of a joint has none."""
    cable = {
        'joints': [['crank_pin', 1], ['knee', -0.5]],
        'position': 0.1,
        'position_gain': 20,
        'velocity_gain': 1,
    }
    effects = {'tendon': {'cable': cable, 'knee': {**cable}}}
    scene = load_scene({'mechanism': 'slider_crank', 'effects': effects})
    changed = overrides.with_changes(scene, {'targets.cable.position': '0.4'})
    assert [each.parameters.position for each in changed.effects] == [0.4, 0.1]
    with pytest.raises(InputError, match="no such target.*did you mean 'targets.cable.position'"):
        overrides.with_changes(scene, {'targets.knee.position': '0.4'})


TABLE = {'joint': 'rail', 'position': [[0, 0], [1, 2]], 'position_gain': 1}


@pytest.mark.parametrize(
    ('motor', 'name', 'told'),
    [
        ({'servo': SERVO}, 'targets.rial.position', "did you mean 'targets.rail.position'"),
        ({'servo': SERVO}, 'targets.rail.effort', 'no such target'),
        ({'a': SERVO, 'b': SERVO}, TARGET, r'several effects.*motor\.a\.pos.*motor\.b\.pos'),
        ({'push': {'joint': 'rail', 'effort': 1}}, TARGET, 'nothing follows its position'),
        ({'speed': {'joint': 'rail', 'velocity_gain': 1}}, TARGET, 'there with position_gain'),
        ({'servo': TABLE}, TARGET, 'not one number'),
        ({'servo': SERVO}, SPEED, r'gives no velocity.*motor\.servo\.velocity, as velocity: 0'),
        ({'servo': SERVO}, 'targets.rail', "no such target.*did you mean 'targets.rail"),
        ({'servo': SERVO}, 'targets..position', "did you mean 'targets.rail.position'"),
        ({'servo': SERVO}, f'{TARGET}[0:10]', f'in some of the steps.*expected {TARGET}, which'),
    ],
)
def test_what_is_refused(motor: Any, name: str, told: str) -> None:
    with pytest.raises(InputError, match=told) as error:
        overrides.number(block(motor), name)
    assert '\n' not in str(error.value)


def test_a_number_of_the_scene_comes_first() -> None:
    """An effect that is called `targets` has its own numbers."""
    scene = block({'targets': SERVO})
    assert overrides.number(scene, 'targets.position') == 0.1
    assert not overrides.is_target(scene, 'targets.position')
    assert overrides.number_name(scene, 'targets.position') == 'targets.position'

"""Tangents and gradients by inputs, over a run and over some of its steps."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alf_ros import Simulation, gradient, load_scene
from alf_ros.__main__ import main as program
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.ros.recording.run_writer import LogRun
from alf_ros.scene.scene import Scene
from alf_ros.simulation import setup

EFFORT = 'joints.crank_pin.effort'
BLOCK = """
mechanism:
  alf: 1
  space: planar
  points: {O: {at: [0, 0], fixed: true}, P: {at: [0, 0]}, R: {at: [1, 0]}}
  bodies: {block: {points: [P, R], mass: 2.5, inertia: rod}}
  joints: {rail: {type: prismatic, between: [ground, block], at: P, axis: [1, 0]}}
solver: {step: 0.01, integrator: rk4}
"""
SPATIAL = """
mechanism:
  alf: 1
  space: spatial
  points:
    O: {at: [0, 0, 0], fixed: true}
    A: {at: [0.7, 0, 0.1]}
    B: {at: [1.2, 0.4, 0]}
  bodies:
    upper: {points: [O, A], mass: 1.5, inertia: {about_com: [0.02, 0.1, 0.09]}}
    lower: {points: [A, B], mass: 0.8, inertia: {about_com: [0.01, 0.05, 0.05]}}
  joints:
    shoulder: {type: universal, between: [ground, upper], at: O, axes: [[0, 0, 1], [0, 1, 0]]}
    elbow: {type: revolute, between: [upper, lower], at: A, axis: [0, 1, 0.3]}
effects:
  gravity: {acceleration: [0, 0, -9.81]}
  motor: {servo: {joint: elbow, position: 0.3, position_gain: 15, velocity_gain: 0.4}}
solver: {step: 1.0e-3}
"""
SETTINGS = [
    pytest.param({}, id='rk4'),
    pytest.param({'integrator': 'dop853_adaptive', 'tolerance': 1e-8}, id='dop853_adaptive'),
    pytest.param({'integrator': 'esdirk43'}, id='esdirk43'),
]


def scene_of(text: str, tmp_path: Path) -> Scene:
    path = tmp_path / 'scene.yaml'
    path.write_text(text, 'utf-8')
    return load_scene(path)


def motion(simulation: Simulation, name: str) -> np.ndarray[Any, Any]:
    """δq and δq̇ by a number."""
    tangent = simulation.sample().tangents[name]
    return np.concatenate([tangent.q, tangent.qd])


def same(found: np.ndarray[Any, Any], wanted: np.ndarray[Any, Any], part: float) -> None:
    assert np.abs(wanted).max() > 1e-6
    np.testing.assert_allclose(found, wanted, rtol=0, atol=part * np.abs(wanted).max())


# ------------------------------------------------------------------------- a known solution


@pytest.mark.parametrize(('first', 'end'), [(0, None), (0, 40), (30, 70), (60, None), (99, 100)])
def test_a_pushed_block_is_exact(first: int, end: int | None, tmp_path: Path) -> None:
    """m ẍ = u: a push from t₁ to t₂ moves it by (t₂ - t₁) (t - (t₁ + t₂)/2) / m."""
    steps = f'[{first or ""}:{"" if end is None else end}]'
    names = [f'joints.rail.effort{steps}', f'wrenches.block.force.x{steps}']
    simulation = Simulation(scene_of(BLOCK, tmp_path), tangents=names)
    simulation.apply_effort('rail', 0.7)
    simulation.step(80)
    simulation.apply_effort('rail', -0.4)
    simulation.step(20)
    begins, ends = 0.01 * first, 1.0 if end is None else 0.01 * end
    moved = (ends - begins) * (1.0 - 0.5 * (begins + ends)) / 2.5
    for name in names:
        rail = simulation.sample().tangents[name].joints['rail']
        assert rail.position == pytest.approx(moved, rel=1e-12)
        assert rail.velocity == pytest.approx((ends - begins) / 2.5, rel=1e-12)
        pushed = simulation.sample().tangents[name].of('joints.rail.effort')
        is_effort = name.startswith('joints') and end in (None, 100)
        assert pushed == pytest.approx(float(is_effort), abs=1e-10)


# --------------------------------------------------------------- effects in place of inputs


CRANK: dict[str, Any] = {
    'mechanism': 'slider_crank',
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
    'initial': {'velocities': {'B': [-4.0, 0]}},
    'solver': {'step': 1e-3},
}
PUSHED = {
    **CRANK,
    'effects': {
        **CRANK['effects'],
        'joint_effort': {'push': {'joint': 'crank_pin', 'effort': 0}},
        'constant_wrench': {'pull': {'on': 'B', 'force': [1e-9, 0]}},
    },
}


@pytest.mark.parametrize('settings', SETTINGS)
def test_equals_an_effect_in_its_place(settings: dict[str, Any]) -> None:
    """Through singular positions, where the method follows them."""
    wanted = Simulation(load_scene(PUSHED), tangents=['push.effort', 'pull.force.0'], **settings)
    found = Simulation(load_scene(CRANK), tangents=[EFFORT, 'wrenches.B.force.x'], **settings)
    steps = 300 if settings.get('integrator') == 'esdirk43' else 1200
    wanted.step(steps)
    found.step(steps)
    same(motion(found, EFFORT), motion(wanted, 'push.effort'), 1e-9)
    same(motion(found, 'wrenches.B.force.x'), motion(wanted, 'pull.force.0'), 1e-6)


def test_a_target_equals_the_number_of_its_motor(tmp_path: Path) -> None:
    names = ['servo.position', 'targets.elbow.position']
    simulation = Simulation(scene_of(SPATIAL, tmp_path), tangents=names)
    simulation.step(400)
    same(motion(simulation, names[1]), motion(simulation, names[0]), 1e-12)


# ---------------------------------------------------------------------- differences of runs


Push = Callable[[Simulation, float], None]


def torque_in_space(simulation: Simulation, by: float) -> None:
    simulation.apply_wrench('lower', [0.3, 0.0, 1.0], [0.0, 0.2 + by, -0.1])


def force_on_a_point(simulation: Simulation, by: float) -> None:
    simulation.apply_wrench('B', [0.5, 0.0, by])


def over_time(simulation: Simulation, by: float) -> None:
    pieces = ((0.0, 1.0 + by, 2.0, 0.0, 0.0, 0.0, 0.0), (0.2, 1.4 + by, 0.0, 0.0, 0.0, 0.0, 0.0))
    simulation.apply_effort('elbow', Curve(pieces))


def target(simulation: Simulation, by: float) -> None:
    simulation.apply_target('elbow', 0.8 + by)


@pytest.mark.parametrize(
    ('name', 'push'),
    [
        ('wrenches.lower.torque.y', torque_in_space),
        ('wrenches.B.force.z', force_on_a_point),
        ('joints.elbow.effort', over_time),
        ('targets.elbow.position', target),
    ],
)
def test_equals_differences_of_runs(name: str, push: Push, tmp_path: Path) -> None:
    """Of inputs that change on the way, in some of the steps."""
    scene, within = scene_of(SPATIAL, tmp_path), f'{name}[120:260]'

    def end(begins: int, ends: int, by: float) -> np.ndarray[Any, Any]:
        simulation = Simulation(scene)
        simulation.step(50)
        for step in (begins, ends, 300):
            push(simulation, by if simulation.step_index == begins else 0.0)
            simulation.step(step - simulation.step_index)
        return np.concatenate([simulation.sample().q, simulation.sample().qd])

    def slope(begins: int, ends: int) -> np.ndarray[Any, Any]:
        h, weights = 0.02, (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
        each = [
            w / h * (end(begins, ends, k * h) - end(begins, ends, -k * h))
            for k, w in enumerate(weights, 1)
        ]
        return np.sum(each, axis=0)

    simulation = Simulation(scene, tangents=[name, within, f'{name}[:50]'])
    simulation.step(50)
    push(simulation, 0.0)
    simulation.step(250)
    same(motion(simulation, name) - motion(simulation, f'{name}[:50]'), slope(50, 300), 3e-8)
    same(motion(simulation, within), slope(120, 260), 3e-8)


# ------------------------------------------------------------------------------ some steps


WINDOWS = [f'{EFFORT}[:117]', f'{EFFORT}[117:300]', f'{EFFORT}[300:]']


@pytest.mark.parametrize('settings', SETTINGS[:2])
@pytest.mark.parametrize('watch', [False, True])
def test_parts_add_up_and_the_run_keeps_its_bits(settings: dict[str, Any], watch: bool) -> None:
    names = [EFFORT, *WINDOWS, 'coupler.mass']
    followed = Simulation(load_scene(CRANK), tangents=names, watch=watch, **settings)
    plain = Simulation(load_scene(CRANK), **settings)
    for simulation in (followed, plain):
        simulation.step(150)
        simulation.apply_effort('crank_pin', 2.0)
        simulation.step(350)
        simulation.clear_inputs()
        simulation.step(100)
    assert followed.state.q.tobytes() == plain.state.q.tobytes()
    assert followed.state.qd.tobytes() == plain.state.qd.tobytes()
    parts = sum(motion(followed, name) for name in WINDOWS)
    same(np.asarray(parts), motion(followed, EFFORT), 1e-12)


def test_steps_one_by_one_and_copies() -> None:
    """How the steps are divided among calls makes no difference."""
    whole = Simulation(load_scene(CRANK), tangents=WINDOWS)
    whole.step(400)
    single = Simulation(load_scene(CRANK), tangents=WINDOWS)
    for _ in range(200):
        single.step()
    for other in (copy.copy(single), pickle.loads(pickle.dumps(single))):
        other.step(200)
        assert other.state.tangents.tobytes() == whole.state.tangents.tobytes()


# -------------------------------------------------------------------------------- gradients


@pytest.mark.parametrize('settings', SETTINGS)
def test_gradients_equal_tangents(settings: dict[str, Any]) -> None:
    """In one pass back, for the efforts of many steps."""
    steps, held = 300, [f'{EFFORT}[{n}:{n + 60}]' for n in range(0, 300, 60)]
    names = [EFFORT, *held, 'wrenches.B.force.x[40:]', 'coupler.mass']
    simulation = Simulation(load_scene(CRANK), tangents=names, **settings)
    plain = Simulation(load_scene(CRANK), **settings)
    for each in (simulation, plain):
        each.apply_effort('crank_pin', 1.5)
    simulation.step(steps)
    for of in ('points.B.x', 'joints.crank_pin.velocity'):
        found = gradient(plain, f'final({of})', names, duration=steps * plain.h)
        wanted = np.array([simulation.sample().tangents[name].of(of) for name in names])
        slopes = np.array([found.by[name] for name in names])
        same(slopes, wanted, 1e-9)
        assert slopes[1 : 1 + len(held)].sum() == pytest.approx(slopes[0], rel=1e-11)
    powers = gradient(plain, 'final(joints.crank_pin.effort)', names, duration=steps * plain.h)
    assert powers.by[EFFORT] == pytest.approx(1.0, abs=1e-9)
    assert powers.by[held[-1]] == pytest.approx(1.0, abs=1e-9)
    assert powers.by[held[0]] == 0.0


def test_a_mean_of_what_the_input_is_part_of() -> None:
    """The mean of an acceleration over the steps of a push: the push counts in these alone."""
    names = [EFFORT, f'{EFFORT}[:100]', f'{EFFORT}[100:]']
    simulation = Simulation(load_scene(CRANK))
    mean = gradient(simulation, 'mean(joints.crank_pin.effort)', names, duration=0.2)
    assert mean.by[EFFORT] == pytest.approx(1.0, rel=1e-9)
    assert mean.by[names[1]] == pytest.approx(0.5, abs=6e-3)
    assert mean.by[names[1]] + mean.by[names[2]] == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize('steps', ['[200:300]', '[200:]', '[:10]'])
def test_steps_outside_of_the_run_are_refused(steps: str) -> None:
    """No derivative of zero for a number that is never added."""
    simulation = Simulation(load_scene(CRANK))
    simulation.step(10)
    with pytest.raises(InputError, match=r'acts in no step of the run.*within \[10:110\]'):
        gradient(simulation, 'final(points.B.x)', [f'{EFFORT}{steps}'], duration=0.1)


def test_efforts_of_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recorded effort, from the step on that it was held from."""
    run = LogRun(tmp_path / 'log', setup.made(load_scene(CRANK), {}))
    simulation, steps = run.setup.simulation, run.setup.steps
    run.send()
    for tick in range(30):
        if tick == 12:
            simulation.apply_effort('crank_pin', 1.5)
            run.note({'kind': 'effort', 'cause': 'command', 'name': 'crank_pin', 'effort': 1.5})
        simulation.step(steps)
        run.send()
    run.close()
    name, file = f'{EFFORT}[{12 * steps}:]', tmp_path / 'gradient.json'
    followed = Simulation(load_scene(CRANK), tangents=[name])
    followed.step(12 * steps)
    followed.apply_effort('crank_pin', 1.5)
    followed.step(18 * steps)
    log = str(run.recorder.path)
    call = ['gradient', log, '--of', 'final(points.B.x)', '--by', name, '--json', str(file)]
    assert program(call) == 0
    assert f'{name} ' in capsys.readouterr().out
    found = json.loads(file.read_text('utf-8'))['by'][name]
    assert found == pytest.approx(followed.sample().tangents[name].points['B'][0], rel=1e-11)


# --------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ('name', 'told'),
    [
        ('joints.crank_pn.effort', 'no such quantity'),
        ('joints.crank_pin.torque', 'no such quantity'),
        ('crank_pin.effort', 'expected joints.crank_pin.effort'),
        (f'{EFFORT}[20:20]', f'expected {EFFORT}[100:200]'),
        (f'{EFFORT}[0:0]', f'expected {EFFORT}[100:200]'),
        (f'{EFFORT}[9007199254740992:]', f'expected {EFFORT}[100:200]'),
        (f'{EFFORT}[:99999999999999999999]', 'no such quantity'),
        (f'{EFFORT}[a:3]', 'no such quantity'),
        (f'{EFFORT}[-5:3]', 'no such quantity'),
        ('wrenches.coupler.torque.z', 'no such quantity'),
    ],
)
def test_names_are_refused(name: str, told: str) -> None:
    with pytest.raises(InputError) as error:
        Simulation(load_scene(CRANK), tangents=[name])
    assert told in str(error.value)


def test_beside_a_wrench_in_the_frame_of_the_body() -> None:
    """The number is a force in the world, whatever is held beside it."""
    names = ['wrenches.coupler.force.x', 'wrenches.coupler.torque']
    simulation = Simulation(load_scene(CRANK), tangents=names)
    simulation.apply_wrench('coupler', [1.0, 0.0], frame='body')
    simulation.step(100)

    def end(force: float, torque: float) -> np.ndarray[Any, Any]:
        effects = {
            **PUSHED['effects'],
            'constant_wrench': {
                'own': {'on': 'coupler', 'force': [1.0, 0.0], 'frame': 'body'},
                'more': {'on': 'coupler', 'force': [force, 0.0], 'torque': torque},
            },
        }
        other = Simulation(load_scene({**PUSHED, 'effects': effects}))
        other.step(100)
        return np.concatenate([other.sample().q, other.sample().qd])

    h = 1e-4
    same(motion(simulation, names[0]), (end(h, 0.0) - end(-h, 0.0)) / (2.0 * h), 1e-7)
    same(motion(simulation, names[1]), (end(0.0, h) - end(0.0, -h)) / (2.0 * h), 1e-7)


def test_a_target_beside_a_curve_is_refused(tmp_path: Path) -> None:
    """And is not held."""
    scene = scene_of(SPATIAL, tmp_path)
    simulation = Simulation(scene, tangents=['targets.elbow.position'])
    with pytest.raises(InputError, match='the motor follows a curve'):
        simulation.apply_target('elbow', Curve(((0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0),)))
    assert not simulation.state.inputs.targets
    simulation.step(10)


def test_an_effect_may_have_the_name() -> None:
    """A number of the scene comes before an input."""
    effects = {**CRANK['effects'], 'joint_effort': {'joints': {'joint': 'crank_pin', 'effort': 1}}}
    scene = load_scene({**CRANK, 'effects': effects})
    simulation = Simulation(scene, tangents=['joints.effort', EFFORT])
    simulation.step(50)
    same(motion(simulation, 'joints.effort'), motion(simulation, EFFORT), 1e-12)

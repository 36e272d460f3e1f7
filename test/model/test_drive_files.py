"""Drives as users write them: tables, mistakes, motions that cannot begin."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from alf_ros import AssemblyError, InputError, Simulation, StepError, load_scene
from alf_ros.scene.scene import scene_from_text
from support.driven_mechanisms import ARM, BELT, GRAVITY, pendulum


def test_a_table_begins_and_ends_at_rest(tmp_path: Any) -> None:
    """Read from a file, written out in the text of the scene, and held behind its end."""
    (tmp_path / 'way.csv').write_text('t, angle\n0, 0\n0.5, 0.4\n1, 1\n', encoding='utf-8')
    (tmp_path / 'mechanism.yaml').write_text(
        """
alf: 1
points: {O: {at: [0, 0], fixed: true}, A: {at: [1, 0]}}
bodies: {rod: {points: [O, A], mass: 2.0, inertia: rod}}
joints: {pin: {type: revolute, between: [ground, rod], at: O}}
drives: {motor: {joint: pin, angle: {table: way.csv}}}
""",
        encoding='utf-8',
    )
    (tmp_path / 'scene.yaml').write_text('mechanism: mechanism.yaml\n', encoding='utf-8')
    scene = load_scene(tmp_path / 'scene.yaml')
    assert 'way.csv' not in scene.text
    again = scene_from_text(scene.text)
    for each in (scene, again):
        samples = list(Simulation(each).run(1.5, at=[0.0, 0.5, 1.0, 1.5]))
        angles = [sample.joints['pin'].position for sample in samples]
        rates = [sample.joints['pin'].velocity for sample in samples]
        assert angles == pytest.approx([0.0, 0.4, 1.0, 1.0], abs=1e-12)
        assert rates[0] == pytest.approx(0.0, abs=1e-12)
        assert rates[2:] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    'drive',
    [
        {'joint': 'crank_pin', 'angle': 'way.csv'},
        {'points': ['O', 'B'], 'length': 'way.csv'},
        {'point': 'B', 'at': 'way.csv'},
    ],
)
def test_a_file_without_its_key_is_refused_with_the_way_to_write_it(drive: Any) -> None:
    with pytest.raises(InputError, match=r'expected \{table: way\.csv\}'):
        load_scene({'mechanism': 'slider_crank', 'drives': {'motor': drive}})


def test_what_comes_to_rest_stays_there() -> None:
    """The remaining velocity decreases from step to step until its square underflows."""
    table = [[0, 0], [0.5, 0.4], [1, 1]]
    mechanism = {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'rod': {'points': ['O', 'A'], 'mass': 2.0, 'inertia': 'rod'}},
        'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
        'drives': {'motor': {'joint': 'pin', 'angle': {'table': table}}},
    }
    sim = Simulation(load_scene({'mechanism': mechanism}))
    sim.step(2000)
    assert sim.sample().joints['pin'].position == pytest.approx(1.0, abs=1e-12)
    assert np.abs(sim.sample().qd).max() < 1e-100


def test_a_driven_run_repeats_from_a_state_bit_for_bit() -> None:
    sim = Simulation(load_scene({'mechanism': ARM, 'effects': GRAVITY}))
    sim.step(100)
    state = sim.state
    sim.step(150)
    end = sim.state
    sim.restore(state)
    sim.step(70)
    sim.step(80)
    assert np.array_equal(sim.state.q, end.q)
    assert np.array_equal(sim.state.qd, end.qd)


def test_nothing_is_compiled_where_nothing_is_driven() -> None:
    assert Simulation(load_scene('slider_crank')).model.system.prescribed.program.size == 0


@pytest.mark.parametrize(
    ('drive', 'message'),
    [
        ({'joint': 'pin', 'angle': 'floor(t)'}, 'floor makes a function of time jump'),
        ({'joint': 'pin', 'angle': 't % 2'}, '% makes a function of time jump'),
        ({'joint': 'pin', 'angle': 'sin(tt)'}, "unknown name 'tt'"),
        ({'joint': 'pin', 'length': 't'}, "the coordinate of 'pin' is no length"),
        ({'joint': 'pinn', 'angle': 't'}, 'did you mean .*pin'),
        ({'joint': 'pin', 'angel': 't'}, 'did you mean .*angle'),
        ({'joint': 'pin'}, 'no motion'),
        ({'point': 'O', 'at': ['t', 0]}, 'this point is fixed'),
        ({'point': 'A', 'at': ['t']}, 'a list of 2'),
        ({'point': 'A', 'at': [None, None]}, 'drives nothing'),
        ({'points': ['O', 'O'], 'length': 't'}, 'both points are fixed'),
        ({'joint': 'pin', 'point': 'A', 'angle': 't'}, 'the driven joint or point is missing'),
        ({'joint': 'pin', 'angle': {'table': []}}, 'an empty table'),
        ({'joint': 'pin', 'angle': {'table': [[], []]}}, 'a table of 0 columns'),
        ({'joint': 'pin', 'angle': {'table': [[0, 1]]}}, 'two rows at least'),
        ({'joint': 'pin', 'angle': {'table': [[0, 1], [0, 2]]}}, 'must ascend'),
        ({'joint': 'pin', 'angle': {'table': [[0, 1, 2], [1, 2, 3]]}}, 'a table of 3 columns'),
    ],
)
def test_mistakes_in_drives(drive: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_scene(pendulum(drives={'motor': drive}))


def test_time_is_not_a_parameter() -> None:
    scene = pendulum(drives={'motor': {'joint': 'pin', 'angle': 't'}}, parameters={'t': 1})
    with pytest.raises(InputError, match='t is the time here'):
        load_scene(scene)


@pytest.mark.parametrize(
    ('angle', 'message'),
    [
        ('3', 'more than a right angle from the drawing'),
        *(
            (each, 'drives.motor: this motion has no value, rate or acceleration at t = 0')
            for each in ('log(t)', 't*sin(t)/t', 'sqrt(t)', 'hypot(t, t)', 'max(0, sqrt(t - 1))')
        ),
    ],
)
def test_motions_that_cannot_begin(angle: str, message: str) -> None:
    scene = load_scene(pendulum(drives={'motor': {'joint': 'pin', 'angle': angle}}))
    with pytest.raises(AssemblyError, match=message):
        Simulation(scene)


@pytest.mark.parametrize('angle', ['sqrt(0.05 - t)', 'asin(20*t)', '(0.0505 - t)**1.5'])
def test_a_motion_that_ends_ends_the_step_with_its_name(angle: str) -> None:
    """The simulation keeps the state before the failed step, and no value of it is NaN."""
    drawn = {'sqrt(0.05 - t)': 0.05**0.5, '(0.0505 - t)**1.5': 0.0505**1.5}.get(angle, 0.0)
    scene = pendulum(drives={'motor': {'joint': 'pin', 'angle': f'{angle} - {drawn}'}})
    simulation = Simulation(load_scene(scene), step=1e-2, integrator='rk4')
    with pytest.raises(StepError, match="the motion 'motor' has no value.* at t = 0.05"):
        simulation.step(20)
    sample = simulation.sample()
    assert 0.0 < simulation.t < 0.06
    assert all(np.isfinite(x).all() for x in (sample.q, sample.qd, sample.qdd, sample.lam))


@pytest.mark.parametrize(
    ('speed', 'error', 'message'),
    [
        ('t*sin(t)/t', AssemblyError, 'joints.rim: this motion has no value.* at t = 0'),
        ('sqrt(0.05 - t)', StepError, "the motion 'rim' has no value.* at t = 0.05"),
    ],
)
def test_a_belt_without_a_speed_is_named(speed: str, error: type, message: str) -> None:
    scene: Any = copy.deepcopy(BELT)
    scene['mechanism']['joints']['rim']['on']['speed'] = speed
    with pytest.raises(error, match=message):
        Simulation(load_scene(scene), step=1e-2, integrator='rk4').step(20)

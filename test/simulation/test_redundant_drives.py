"""Efforts of drives that hold the same freedom: their sum is unique, each one is not."""

from __future__ import annotations

from typing import Any

import pytest

from alf_ros import InputError, Simulation, equilibrium, load_scene, record
from alf_ros.ros.simulator import diagnostics
from alf_ros.simulation.named_quantity import named_quantity
from alf_ros.simulation.sample import Sample
from alf_ros.studies.statics import rest_report

_GRAVITY = {'gravity': {'acceleration': [0, -9.81]}}


def driven(drives: dict[str, Any], mechanism: Any = 'four_bar') -> Simulation:
    scene = {'mechanism': mechanism, 'effects': _GRAVITY, 'drives': drives}
    return Simulation(load_scene(scene))


def held(joints: list[str]) -> dict[str, Any]:
    """A drive for each joint of the four-bar, which holds it as drawn."""
    drawn = Simulation(load_scene('four_bar')).sample()
    return {f'at_{name}': {'joint': name, 'angle': drawn.joints[name].position} for name in joints}


def open_drives(sample: Sample) -> set[str]:
    return {name for name, flags in sample.open_drive_efforts.items() if flags.any()}


def test_one_drive_for_one_freedom_is_unique() -> None:
    sample = driven(held(['crank_pin'])).sample()
    assert not open_drives(sample) and not sample.open_joint_efforts.any()


def test_two_drives_at_two_joints_of_a_loop_are_one_of_many() -> None:
    simulation = driven(held(['crank_pin', 'rocker_pin']))
    sample = simulation.sample()
    assert open_drives(sample) == {'at_crank_pin', 'at_rocker_pin'}
    flags = {name: state.indeterminate for name, state in sample.joints.items()}
    assert [name for name, flag in flags.items() if flag] == ['crank_pin', 'rocker_pin']
    run = record(simulation, 0.01)
    efforts = {name for name in run.indeterminate if name.endswith('effort')}
    assert efforts == {
        'joints.crank_pin.effort',
        'joints.rocker_pin.effort',
        'drives.at_crank_pin.effort',
        'drives.at_rocker_pin.effort',
    }
    told = diagnostics.constraints(sample).values
    assert told['indeterminate_efforts'] == 'at_crank_pin, at_rocker_pin'
    rest = equilibrium(simulation)
    table = rest_report.report(rest)
    assert table.count('one of many') == 2 + sum(r.indeterminate for r in rest.reactions.values())


def bar(stiffness: dict[str, float] | None = None) -> dict[str, Any]:
    pin = {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}
    return {
        'alf': 1,
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'bar': {'points': ['O', 'A'], 'mass': 1.0, 'inertia': 'rod'}},
        'joints': {'pin': {**pin, 'stiffness': stiffness} if stiffness else pin},
    }


TURN = {'joint': 'pin', 'angle': 0.0}
LIFT = {'point': 'A', 'at': [None, '0']}


def test_a_drive_of_a_point_beside_one_of_its_joint() -> None:
    """Both hold the end of the bar against its weight; moments about the pin have one sum."""
    sample = driven({'turn': TURN, 'lift': LIFT}, bar()).sample()
    assert sample.open_drive_efforts['turn'].tolist() == [True]
    assert sample.open_drive_efforts['lift'].tolist() == [False, True]
    assert sample.open_motion_efforts.tolist() == [True, True]
    torque = sample.drive_efforts['turn'][0] + sample.drive_efforts['lift'][1]
    assert torque == pytest.approx(9.81 / 2.0, rel=1e-12)


def test_bearings_decide_the_shares_of_drives_that_load_them() -> None:
    """Least energy leaves the pin without load."""
    mechanism = bar({'translation': 1e6})
    sample = driven({'turn': TURN, 'lift': LIFT}, mechanism).sample()
    assert not open_drives(sample)
    assert sample.drive_efforts['lift'][1] == pytest.approx(9.81, rel=1e-10)
    assert sample.drive_efforts['turn'][0] == pytest.approx(-9.81 / 2.0, rel=1e-10)


def test_the_derivative_of_an_effort_that_is_one_of_many_is_refused() -> None:
    sample = driven({'turn': TURN, 'lift': LIFT}, bar()).sample()
    with pytest.raises(InputError, match='one of many'):
        named_quantity('drives.turn.effort', 'of', sample).check_unique(sample)

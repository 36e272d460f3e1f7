"""Adaptive steps in lanes: each member has lengths of its own, and the bits of its single run."""

from __future__ import annotations

import copy
import operator
from typing import Any

import pytest

from alf_ros import Ensemble, Simulation, StepError, load_scene
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.scene.overrides import with_changes
from alf_ros.simulation.side_by_side import SideBySide
from support.side_by_side_members import check, member
from support.singular_starts import scene
from support.thorough import thinned

pytestmark = pytest.mark.skipif(PLAIN, reason='code that is not compiled has no lanes')

DOWN, BELOW = 'gravity.acceleration.1', 'gravity.acceleration.2'
# what differs from member to member, step of the grid (s), steps
LIBRARY: dict[str, tuple[dict[str, Any], float, int]] = {
    'slider_crank': ({'coupler.mass': '{1+k/50}', DOWN: '{-9-k/8}'}, 2e-2, 100),
    'double_pendulum': ({DOWN: '{-9-k/8}'}, 5e-2, 50),
    'change_point': ({'m': '{1+k/40}', DOWN: '{-9-k/8}'}, 2e-2, 75),
    'n_four_bar': ({DOWN: '{-9-k/8}'}, 5e-2, 40),
    'scissor_lift': ({DOWN: '{-9-k/8}'}, 2e-2, 15),
    'wiper': ({DOWN: '{-9-k/8}'}, 2e-2, 25),
    'delta_robot': ({BELOW: '{-9-k/8}'}, 5e-2, 15),
    'delta_robot_controlled': ({BELOW: '{-9-k/8}'}, 2e-2, 15),
    'bricard': ({BELOW: '{-9-k/8}'}, 5e-2, 20),  # rounding of dependent rows is no slow mode
    'coin': ({BELOW: '{-9-k/8}'}, 2e-2, 25),
    'differential_drive_cart': ({}, 2e-2, 15),
}
TOLERANCES = 1e-4, 1e-6, 1e-9


def adaptive(name: Any, changes: dict[str, Any], k: int, **settings: Any) -> Simulation:
    return member(name, changes, k, integrator='dop853_adaptive', **settings)


@pytest.mark.parametrize(
    'name', thinned(LIBRARY, lambda name: name not in ('n_four_bar', 'double_four_bar'))
)
def test_members_have_the_bits_of_their_single_runs(name):
    changes, h, steps = LIBRARY[name]
    made = [
        adaptive(name, changes, k, step=h, tolerance=tolerance)
        for tolerance in TOLERANCES
        for k in range(3)
    ]
    alone = [copy.copy(each) for each in made]
    together = SideBySide(made)
    assert together.patterns == len(TOLERANCES)
    for n in (1, steps - 4, 3):
        assert together.step(n) == {}
        for each in alone:
            each.step(n)
        check(made, alone)


def test_numbers_of_steps_differ_from_member_to_member():
    """From rest to fast, on one grid: the slow ones do not wait for the lengths of the fast ones,
    nor take them."""
    made = [
        adaptive('double_pendulum', {DOWN: '{-0.1-60*k}'}, k, step=0.1, tolerance=1e-9)
        for k in range(4)
    ]
    alone = [copy.copy(each) for each in made]
    SideBySide(made).step(20)
    for each in alone:
        each.step(20)
    check(made, alone)
    counts = [each.evaluations for each in made]
    assert sorted(counts) == counts and counts[-1] > 3 * counts[0]
    assert any(count % made[0].stages for count in counts)  # refused steps keep their first stage


@pytest.mark.parametrize('speed', [{}, {'free_speed': 6.0}])
def test_kinks_of_forces(speed):
    """Motors that members drive to their limits at other times, and one that has none there."""
    scenes = [
        load_scene(
            {
                'mechanism': 'slider_crank',
                'effects': {
                    'gravity': {'acceleration': [0, -9.81]},
                    'motor': {
                        'joint': 'crank_pin',
                        'position': place,
                        'position_gain': 60.0,
                        'velocity_gain': 2.0,
                        'limit': 12.0,
                        **speed,
                    },
                    'damper': {'between': ['O', 'B'], 'damping': 0.1},
                },
                'initial': {'positions': {'A': [0.8, 0.6]}, 'velocities': {'A': [-0.6, 0.8]}},
            }
        )
        for place in (0.8, 1.1, 1.4, 0.7)
    ]
    made = [
        adaptive(each, {}, 0, step=5e-2, tolerance=tolerance)
        for tolerance in TOLERANCES
        for each in scenes
    ]
    alone = [copy.copy(each) for each in made]
    assert SideBySide(made).step(16) == {}
    for each in alone:
        each.step(16)
    check(made, alone)


@pytest.mark.parametrize('integrator', ['dop853_adaptive', 'rk4'])
def test_stops_that_some_meet(integrator):
    """Members that come near a stop look along the step for contacts within it, alone."""
    scenes = [
        load_scene(
            {
                'mechanism': 'slider_crank',
                'effects': {
                    'gravity': {'acceleration': [0, -9.81]},
                    'joint_stop': {'joint': 'crank_pin', 'upper': upper, 'stiffness': 1e4},
                },
                'initial': {'positions': {'A': [0.8, 0.6]}, 'velocities': {'A': [-0.6, 0.8]}},
            }
        )
        for upper in (0.7, 0.74, 1.1, 3.0)
    ]
    made = [member(each, {}, 0, step=2e-2, integrator=integrator) for each in scenes]
    alone = [copy.copy(each) for each in made]
    side = SideBySide(made)
    assert side.step(25) == {}
    for each in alone:
        each.step(25)
    check(made, alone)
    assert 0 < side.apart < 80


def test_members_that_wait_take_the_lanes_of_those_that_are_done():
    """Members that turn back beside a singular position take twice as many steps as others. Some
    have a damper: they change places among themselves alone."""
    free = load_scene('slider_crank')
    damped = with_changes(free, {'effects.damper': '{between: [A, B], damping: 0.1}'})
    made = [
        adaptive(scene, {'coupler.length': '{1.12-k/100}'}, k, step=2e-2, penalty=3e9)
        for scene in (free, damped)
        for k in range(2 * width() + 3)
    ]
    alone = [copy.copy(each) for each in made]
    together, apart = SideBySide(made), 0
    for n, without in ((30, ()), (1, (0, 5)), (25, (2,)), (4, ())):
        assert together.step(n, without) == {}
        apart += together.apart
        for k, each in enumerate(alone):
            if k not in without:
                each.step(n)
        check(made, alone)
    lanes = [group.crew.member.tolist() for group in together._groups]
    given = [[*range(n, n + width())] for n in range(0, len(made), width())]
    moved = [now != before for now, before in zip(lanes[:-1], given, strict=False)]
    mixed = [len({k < len(made) // 2 for k in each}) > 1 for each in lanes[:-1]]
    assert any(moved) and any(mixed) and not any(map(operator.and_, moved, mixed))
    # stages whose solves are slow with the factor of a guess are alone, not their steps
    assert apart < 5
    made[0].restore(alone[1].state)
    alone[0].restore(alone[1].state)
    together.step(3)
    for each in alone:
        each.step(3)
    check(made, alone)


def test_many_steps_between_two_points_of_the_grid():
    made = [
        adaptive('slider_crank', {DOWN: '{-9-k/8}'}, k, step=2e-2, tolerance=1e-14)
        for k in range(3)
    ]
    alone = [copy.copy(each) for each in made]
    SideBySide(made).step(20)
    for each in alone:
        each.step(20)
    check(made, alone)


def test_a_step_that_fails_ends_at_the_last_point_of_the_grid():
    """A drive asks one member for a place beyond its reach."""

    def driven(reach: float) -> Simulation:
        drives = {'push': {'joint': 'guide', 'length': f'1.2 + {reach}*t*t'}}
        start = scene(positions={'A': [0.6, 0.8], 'B': [1.2, 0]}, drives=drives, effects={})
        return adaptive(start, {}, 0, step=5e-2, tolerance=1e-8)

    made = [driven(reach) for reach in (0.1, 8.0, 0.2)]
    alone = [copy.copy(each) for each in made]
    failed = SideBySide(made).step(10)
    assert list(failed) == [1]
    with pytest.raises(StepError) as error:
        alone[1].step(10)
    assert str(failed[1]) == str(error.value)
    for each in (alone[0], alone[2]):
        each.step(10)
    check(made, alone)


def test_an_ensemble_in_a_loop():
    ensemble = Ensemble(
        'slider_crank', 3, efforts=['crank_pin'], step=2e-2, integrator='dop853_adaptive'
    )
    alone = Simulation(load_scene('slider_crank'), step=2e-2, integrator='dop853_adaptive')
    for k in range(20):
        ensemble.step([[0.0], [0.5 * k], [1.0]])
        alone.apply_effort('crank_pin', 0.5 * k)
        alone.step()
    other = ensemble.simulation(1)
    assert other.state.q.tobytes() == alone.state.q.tobytes()
    assert other.evaluations == alone.evaluations

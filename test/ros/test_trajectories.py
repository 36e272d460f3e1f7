"""joint_trajectory messages: their conversion to curves, and refused messages."""

import math
from dataclasses import replace

import pytest

from alf_ros.ros.simulator.command_messages import Refused
from alf_ros.ros.simulator.trajectory_command import MOST_POINTS, read_trajectory
from support.effect_scenes import ROTOR, simulate
from support.trajectory_messages import message, point

PD = 'motor: {joint: pin, position: 0.25, position_gain: 40, velocity_gain: 9}'


def read(found):
    return read_trajectory(found, ['pin', 'free'], {'pin': (True, True), 'free': (False, False)})


def curves(simulation, found, ahead=0):
    return read(found).curves(simulation.sample(), ahead)


def command(simulation, found, ahead=0):
    positions, _ = curves(simulation, found, ahead)
    simulation.apply_target('pin', positions['pin'])
    return positions['pin']


@pytest.fixture
def simulation():
    """In motion: at 0.1 s, somewhere on the way to 0.25 rad."""
    simulation = simulate(ROTOR, PD)
    simulation.step(100)
    return simulation


def test_it_starts_now_from_where_the_joint_is(simulation):
    joint = simulation.sample().joints['pin']
    curve = command(simulation, message(point(0.5, [1.0], [0.0]), point(1.0, [2.0], [0.0])))
    assert curve.at(0.1)[:2] == (joint.position, joint.velocity) and joint.velocity > 0.1
    assert curve.at(0.6)[0] == 1.0 and curve.at(1.1) == (2.0, 0.0, 0.0) and curve.end == 1.1


def test_a_stamp_says_when_it_starts(simulation):
    joint = simulation.sample().joints['pin']
    curve = command(simulation, message(point(0.5, [1.0]), start=3.4), ahead=3_000_000_000)
    assert curve.at(0.1) == curve.at(0.4 - 1e-9) == (joint.position, 0.0, 0.0)
    assert curve.at(0.65)[0] == pytest.approx(0.5 * (joint.position + 1.0))
    assert curve.end == pytest.approx(0.9)


def test_a_first_point_at_the_start_is_where_it_jumps_to(simulation):
    curve = command(simulation, message(point(0.0, [1.0]), point(1.0, [2.0])))
    assert curve.at(0.1)[0] == 1.0 and curve.at(0.6)[0] == pytest.approx(1.5)


def test_what_lies_in_the_past_is_left_out(simulation):
    joint = simulation.sample().joints['pin']
    curve = command(simulation, message(point(0.02, [9.0]), point(0.5, [1.0]), start=0.05))
    assert curve.at(0.1)[0] == joint.position and curve.at(0.55)[0] == 1.0
    assert max(curve.at(t)[0] for t in (0.1, 0.2, 0.3, 0.4, 0.5)) < 1.0
    with pytest.raises(Refused, match='in the past') as refused:
        curves(simulation, message(point(0.02, [9.0]), start=0.05))
    assert refused.value.reason == 'wrong_time'


@pytest.mark.parametrize(
    'points',
    [
        (point(1e-9, [1e300], [0.0]), point(2e-9, [0.1], [0.0])),
        (point(1e-9, [1e308]), point(2e-9, [-1e308])),
        (point(1e-9, [0.0], effort=[1e308]), point(2e-9, [0.0], effort=[-1e308])),
    ],
)
def test_points_too_far_apart_for_numbers_are_refused(simulation, points):
    with pytest.raises(Refused, match='no finite curve leads pin') as refused:
        curves(simulation, message(*points))
    assert refused.value.reason == 'not_finite'


def test_points_that_rounding_puts_together_are_refused(simulation):
    state = simulation.state
    simulation.restore(replace(state, step=10**11))  # 1e8 s: a nanosecond is lost there
    with pytest.raises(Refused, match='by rounding') as refused:
        curves(simulation, message(point(1.0, [1.0]), point(1.000000001, [2.0])))
    assert refused.value.reason == 'wrong_time'


def test_stamps_of_another_clock_are_refused(simulation):
    """Of the wall, beside simulated time: the joint was held for years, without a word."""
    with pytest.raises(Refused, match='begins 1.76e.09 s ahead: stamps are of clock') as refused:
        curves(simulation, message(point(0.5, [1.0]), start=1.76e9))
    assert refused.value.reason == 'wrong_time'
    assert curves(simulation, message(point(0.5, [1.0]), start=3600.0))[0]['pin'].end == 3600.5


def test_a_newer_one_takes_over_smoothly_where_it_starts(simulation):
    old = command(simulation, message(point(1.0, [1.0], [0.0], [0.0])))
    simulation.step(100)
    new = command(simulation, message(point(0.5, [-1.0], [0.0], [0.0]), start=0.7))
    assert [new.at(t) for t in (0.2, 0.5, 0.69)] == [old.at(t) for t in (0.2, 0.5, 0.69)]
    for before, after in zip(old.at(0.7), new.at(0.7), strict=True):
        assert after == pytest.approx(before, rel=1e-12)
    assert new.end == pytest.approx(1.2) and new.at(new.end) == (-1.0, 0.0, 0.0)


def test_efforts_are_linear_and_any_joint_takes_them(simulation):
    simulation.apply_effort('pin', 0.4)
    found = message(point(0.1, effort=[1.0]), point(0.2, effort=[-1.0]))
    positions, efforts = curves(simulation, found)
    assert not positions
    at = [efforts['pin'].at(t)[0] for t in (0.1, 0.15, 0.2, 0.25, 0.3, 9.0)]
    assert at == pytest.approx([0.4, 0.7, 1.0, 0.0, -1.0, -1.0])
    assert read(message(point(1.0, effort=[1.0]), names=['free'])).efforts == {'free': [(1.0,)]}


STEP = point(1.0, [1.0])
REFUSED = {
    'no points': (message(), 'no_value'),
    'no joints': (message(STEP, names=()), 'no_value'),
    'nothing in it': (message(point(1.0)), 'no_value'),
    'velocities only': (message(point(1.0, velocities=[0.0])), 'no_value'),
    'no velocities': (message(point(1.0, [1.0], accelerations=[1.0])), 'no_value'),
    'unknown joint': (message(STEP, names=['pni']), 'unknown_name'),
    'a joint twice': (message(point(1.0, [1.0, 1.0]), names=['pin', 'pin']), 'repeated_name'),
    'positions nobody follows': (message(STEP, names=['free']), 'not_controlled'),
    'too few positions': (message(STEP, names=['pin', 'free']), 'wrong_length'),
    'some efforts only': (message(STEP, point(2.0, [1.0], effort=[1.0])), 'wrong_length'),
    'too long': (message(*[STEP] * (MOST_POINTS + 1)), 'wrong_length'),
    'times that stand': (message(STEP, STEP), 'wrong_time'),
    'a time before the start': (message(point(-1.0, [1.0])), 'wrong_time'),
    'not a number': (message(point(1.0, [math.nan])), 'not_finite'),
    'an end in motion': (message(point(1.0, [1.0], [0.1])), 'moving_end'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_what_cannot_be_followed_is_refused(case):
    found, reason = REFUSED[case]
    with pytest.raises(Refused) as refused:
        read(found)
    assert refused.value.reason == reason

"""Measurements that would count twice, or of which chance would choose one, are refused."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from alf_ros import identify, recorded
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.studies.identification.recording_reader import read_recording
from support.foreign_bags import Message, joints, wrench, written
from support.recordings import Machine, scene

FIT = ['coupler.mass', 'pin.viscous']
JOINTS = ('crank_pin', 'guide')
NOW = 1_760_000_000_000_000_000  # ns


@cache
def _positions() -> Floats:
    return Machine(scene(coupler__mass=1.3), JOINTS, 1.0).x


def _states(begin: int = 0, end: int = 101, off: float = 0.0) -> list[Message]:
    """100 Hz."""
    return [
        joints('/joint_states', NOW + k * 10**7, JOINTS, position=_positions()[k] + off)
        for k in range(begin, end)
    ]


def test_measurements_in_two_recordings_count_once(tmp_path: Path) -> None:
    """A copy made the intervals narrower by the square root of two, without a word."""
    whole = written(tmp_path / 'whole', _states())
    copy, late = written(tmp_path / 'copy', _states()), written(tmp_path / 'late', _states(40))
    early = written(tmp_path / 'early', _states(0, 60))
    for pair in ((whole, whole), (whole, copy), (early, late)):
        with pytest.raises(InputError) as caught:
            identify(scene(), pair, FIT, window=0.5)
        text = f'crank_pin: has the same measurements as {pair[0]}, which would count twice'
        assert str(caught.value).startswith(f'{pair[1]}: {text}')
    assert "got '0 s to 0.19 s'" in str(caught.value)
    rest = written(tmp_path / 'rest', _states(59))
    found = identify(scene(), [early, rest], ['coupler.mass'], window=0.4)
    assert found['coupler.mass'] == pytest.approx(1.3, rel=1e-6)


def test_equal_arrays_count_once(tmp_path: Path) -> None:
    """Arrays were counted twice. With another value, or a longer time, they are another run."""
    t, x = np.arange(101) * 0.01, _positions()
    angles = dict(zip(JOINTS, x.T, strict=True))
    first, second = recorded(t, angles), recorded(t, angles)
    bag = read_recording(written(tmp_path / 'bag', _states()), scene())
    for pair in ([first, second], [first, first], [bag, first], [first, bag]):
        with pytest.raises(InputError, match='has the same measurements as .* count twice'):
            identify(scene(), pair, FIT, window=0.5)
    moved = {**angles, 'guide': angles['guide'] + np.where(t == 0.5, 1e-9, 0.0)}
    longer = recorded(t[:-1], {name: values[:-1] for name, values in angles.items()})
    for other in (recorded(t, moved), longer):
        found = identify(scene(), [first, other], ['coupler.mass'], window=0.5)
        assert found['coupler.mass'] == pytest.approx(1.3, rel=1e-6)


def test_other_measurements_at_the_same_stamps_are_others(tmp_path: Path) -> None:
    """As of two runs of a simulator that begin alike."""
    first = written(tmp_path / 'first', _states())
    moved = [*_states(0, 50), *_states(50, off=1e-6)]
    second = written(tmp_path / 'second', moved)
    found = identify(scene(), [first, second], ['coupler.mass'], window=0.4)
    assert found['coupler.mass'] == pytest.approx(1.3, rel=1e-3)


def test_two_values_at_one_stamp_are_refused(tmp_path: Path) -> None:
    """The first one counted, without a word."""
    both = [x for pair in zip(_states(), _states(off=0.3), strict=True) for x in pair]
    said = (
        "crank_pin: two values at one stamp, as of two publishers, got '0.3 apart at 101 stamps'"
    )
    with pytest.raises(InputError, match=said):
        read_recording(written(tmp_path / 'both', both), scene())


def test_two_publishers_in_turn_are_refused(tmp_path: Path) -> None:
    """The fit had wide intervals, and nothing named the cause. A resting encoder may go to and fro
    too, now and then."""
    late = [
        joints('/joint_states', NOW + k * 10**7 + 10**6, JOINTS, position=_positions()[k] + 0.3)
        for k in range(101)
    ]
    both = [x for pair in zip(_states(), late, strict=True) for x in pair]
    said = "crank_pin: goes to and fro from stamp to stamp, as of two publishers, got 'by 0.3"
    with pytest.raises(InputError, match=said):
        read_recording(written(tmp_path / 'both', both), scene())
    steps = np.random.default_rng(1).integers(0, 2, 101) * 1e-3
    rests = [
        joints('/joint_states', NOW + k * 10**7, ['guide'], position=[1.4 + step])
        for k, step in enumerate(steps)
    ]
    (guide,) = read_recording(written(tmp_path / 'rests', rests), scene()).channels
    assert np.array_equal(guide.values, 1.4 + steps)


def test_the_stamps_of_a_slow_clock_are_read(tmp_path: Path) -> None:
    slow = [
        joints('/joint_states', NOW + k // 4 * 4 * 10**7, JOINTS, position=_positions()[k])
        for k in range(101)
    ]
    (pin, _) = read_recording(written(tmp_path / 'slow', slow), scene()).channels
    assert np.array_equal(pin.values, _positions()[::4, 0])


def test_numbers_that_no_joint_has_are_refused(tmp_path: Path) -> None:
    """One of them made a fit far off, with a warning of numpy."""
    wrong = joints('/joint_states', NOW + 5, JOINTS, position=[1e300, 1.4])
    path = written(tmp_path / 'bag', [*_states(0, 1), wrong, *_states(1)])
    with pytest.raises(InputError, match=r'crank_pin: not a position, got 1e\+300; expected less'):
        read_recording(path, scene())


def test_topics_without_positions_say_why(tmp_path: Path) -> None:
    """The message was: 'joint_states'; did you mean '/joint_states'?"""
    names_only = [joints('/joint_states', NOW, JOINTS)]
    halved = [joints('/joint_states', NOW, JOINTS, position=[0.7])]
    other = tmp_path / 'other.mcap'
    with open(other, 'wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema('sensor_msgs/JointState', 'ros1msg', b'')
        channel = writer.register_channel('/joint_states', 'ros1', schema)
        writer.add_message(channel, NOW, bytes(24), NOW)
        writer.finish()
    cases = [
        (written(tmp_path / 'names', names_only), '/joint_states: no positions of joints in this'),
        (written(tmp_path / 'none', []), 'no messages in this recording'),
        (written(tmp_path / 'push', [wrench('/coupler', NOW, [1, 0, 0])]), "got 'joint_states'"),
        (written(tmp_path / 'halved', halved), 'not of its type: 2 names and 1 of position'),
        (other, "/joint_states: not of the type of joint states, got 'sensor_msgs/JointState'"),
    ]
    for path, said in cases:
        with pytest.raises(InputError) as caught:
            read_recording(path, scene())
        assert said in str(caught.value) and 'did you mean' not in str(caught.value)

"""Measurements that count once: no second recording of them, and one value at each stamp."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.studies.identification.recording import MeasuredChannel, Recording

_NS = 1e9  # in a second
_FEW = 10  # equal values: fewer may be chance
_SOME = 5  # stamps with two values: fewer may be turns, or a message that was late
_FAR = 5.0  # times the mean change between two stamps
_MANY = 20  # positions that go to and fro: fewer may be a vibration


def check_recordings(recordings: Sequence[Recording]) -> None:
    """Raises InputError if two recordings have the same measurements: two bags of one run that
    overlap, or a copy. They would count twice, and the intervals be too narrow.

    Arrays have no stamps, so that equal parts may be chance: they are refused if all measurements
    are equal."""
    for first, second in combinations(recordings, 2):
        found = _shared(first, second)
        if found is not None:
            name, begin, end = found
            raise InputError(
                f'has the same measurements as {first.name}, which would count twice',
                file=second.name,
                key=name,
                value=f'{begin:.6g} s to {end:.6g} s',
                expected='each measurement in one recording',
            )


def _shared(first: Recording, second: Recording) -> tuple[str, float, float] | None:
    """A channel that moves and has equal values in both, and from when to when, s of the second;
    None if there is none, or if any value differs at a stamp that both have."""
    if first.origin is None or second.origin is None:
        return _repeated(first, second)
    of_first = {each.name: each for each in first.channels}
    found = None
    for channel in second.channels:
        other = of_first.get(channel.name)
        if other is None:
            continue
        stamps, ours = _stamps(channel, second.origin), _stamps(other, first.origin)
        _, here, there = np.intersect1d(stamps, ours, return_indices=True)
        values = channel.values[here]
        if (values != other.values[there]).any():  # as of two runs of a simulator
            return None
        if found is None and here.size >= _FEW and np.ptp(values) > 0.0:
            found = channel.name, float(channel.t[here[0]]), float(channel.t[here[-1]])
    return found


def _repeated(first: Recording, second: Recording) -> tuple[str, float, float] | None:
    """The same of recordings of which one has no stamps, if all measurements are equal."""
    of_first = {each.name: each for each in first.channels}
    if of_first.keys() != {each.name for each in second.channels}:
        return None
    for channel in second.channels:
        other = of_first[channel.name]
        same = np.array_equal(_stamps(channel, 0), _stamps(other, 0))
        if not same or not np.array_equal(channel.values, other.values):
            return None
    for channel in second.channels:
        if channel.t.size >= _FEW and np.ptp(channel.values) > 0.0:
            return channel.name, float(channel.t[0]), float(channel.t[-1])
    return None


def _stamps(channel: MeasuredChannel, origin: int) -> Integers:
    return np.asarray(np.rint(channel.t * _NS).astype(np.int64) + origin)


def first_at_stamps(t: Floats, values: Floats, file: str, joint: str) -> NDArray[np.bool_]:
    """(N,) whether a measurement is the first at its time t (N,), s, which ascends.

    With the stamps of a slow clock the others lie between the first ones of two times. Raises
    InputError if they are elsewhere: two publishers send there, and which one is first is chance.
    """
    new = np.diff(t, prepend=-np.inf) > 0.0
    if (~new).sum() >= _SOME and new.sum() > 1:
        of = np.maximum.accumulate(np.where(new, np.arange(t.size), 0))
        apart = np.abs(values - values[of])[~new]
        if np.median(apart) > _FAR * np.mean(np.abs(np.diff(values[new]))):
            raise InputError(
                'two values at one stamp, as of two publishers',
                file=file,
                key=joint,
                value=f'{np.median(apart):.3g} apart at {apart.size} stamps',
                expected='one value at each stamp',
            )
    return np.asarray(new)


def check_one_source(positions: Floats, file: str, joint: str) -> None:
    """Raises InputError for positions (N,) that go to and fro: from stamp to stamp they change
    much more than from each to the next but one. Two publishers send there in turn."""
    if positions.size < _MANY:
        return
    next_, after = (np.median(np.abs(positions[n:] - positions[:-n])) for n in (1, 2))
    if next_ > _FAR * after:
        raise InputError(
            'goes to and fro from stamp to stamp, as of two publishers',
            file=file,
            key=joint,
            value=f'by {next_:.3g}',
            expected='one publisher of each joint',
        )

"""Stamps: the simulated time as ROS tells it."""

from __future__ import annotations

import math

from alf_ros.errors import StepError

LAST = 2**31 * 10**9 - 1  # ns: messages of ROS have 31 bits for the seconds
ENDS = f'the stamps of ROS end at {LAST // 10**9} s'


def stamp_ns(t: float, ahead: int = 0) -> int:
    """Stamp (ns) of the simulated time `t` (s), to the nearest nanosecond, and `ahead` (ns) more.

    A stamp of zero means "no time yet" in ROS, so the initial state at t = 0 is stamped 1 ns.
    """
    return max(1, round(t * 1e9) + ahead)


def message_stamp(t: float, ahead: int, now: float) -> int:
    """`stamp_ns` of a message at `t`. Raises StepError, at the time `now` (s), if no message can
    have that stamp."""
    stamp = stamp_ns(t, ahead)
    if stamp > LAST:
        remedy = 'end the run before it, or reset the time'
        raise StepError(ENDS, remedy, now)
    return stamp


def period_of(ns: int, rate: float) -> int:
    """The number of the period of `rate` (Hz) in which an instant with the stamp `ns` lies.

    A stamp may be half a nanosecond before its instant, which may begin a period.
    """
    return math.floor((ns + 0.5) * 1e-9 * rate + 1e-6)

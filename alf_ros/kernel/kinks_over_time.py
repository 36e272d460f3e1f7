"""Kinks over time, which are known before: steps end there.

Tables and trajectories are functions of time in pieces. A step never reaches across the end of a
piece, so forces between two of its stages are as smooth as at the stages. On both sides of a kink
they are evaluated by the piece of that side: stages are within the step by more than the rounding
of t. A step of a fixed length with a kink between its ends is taken in pieces.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, inlined, inner

_SAME = 1e-12  # of the step of the grid, and …
_ROUNDED = 4e-15  # … of t: an instant that near to a time is that time
_BEFORE = 1.0 - 4e-16  # times an instant: just before it
_ROUNDING = 1e-15  # of t: how far stages are within a fixed step, and …
_PART = 0.01  # … of the step, at most


@inlined
def just_behind(t: Any, end: Any) -> Any:
    """The time (s) of the first stage of a fixed step from t to `end`."""
    return t + min(_ROUNDING * max(abs(t), abs(end)), _PART * (end - t))


@inlined
def stage_time(t: Any, end: Any, h: Any, c: float) -> Any:
    """The time (s) of the stage c of a step of h (s) from t to `end`: before its end."""
    return min(t + c * h, end - min(_ROUNDING * abs(end), _PART * (end - t)))


@inlined
def end_of_drives(to: Any, end: Any, whole: Any) -> Any:
    """The time (s) of the drives where a step to `to` (s) ends: at a point of the grid (`whole`)
    the one of the grid, `end` (s), with a kink beside it or not.

    A state there is known by its number of steps. Which kinks the step had is not, as inputs are
    replaced.
    """
    return end if whole else to


@inner
def piece_to_kink(
    instants: Floats, t: float, end: float, h: float, done: float, aim: float
) -> tuple[float, float, float]:
    """A piece of a fixed step of h (s) from t to `end` (s), from `done` to `aim` (s) behind t or
    to a kink before: its begin and end (s), and where it ends behind t; h at the end of the
    step."""
    begin, latest = t + done, np.inf
    if instants.size > 0:
        ahead, earliest, latest = until_kink(instants, begin, aim - done, h)
        begin = max(begin, earliest)
        if ahead < aim - done:
            aim = done + ahead
    return begin, min(end if aim == h else t + aim, latest), aim


@inner
def until_kink(instants: Floats, t: float, left: float, h: float) -> tuple[float, float, float]:
    """How long (s) a step from t (s) may be, at most `left` (s), and the times (s) before and
    behind which it has no stages; h: the step of the grid."""
    near = _SAME * h + _ROUNDED * abs(t)
    n = _first_behind(instants, t + near)
    earliest, latest = -np.inf, np.inf
    if n > ZERO:
        earliest = instants[n - ONE]
    if n < instants.size and instants[n] <= t + left + near:
        latest = instants[n] * _BEFORE
        if instants[n] < t + left - near:
            left = instants[n] - t
    return left, earliest, latest


@inner
def _first_behind(instants: Floats, t: float) -> np.uint64:
    """The number of the first instant behind t."""
    low, high = ZERO, np.uint64(instants.size)
    while low < high:
        middle = (low + high) // TWO
        if instants[middle] <= t:
            low = middle + ONE
        else:
            high = middle
    return low

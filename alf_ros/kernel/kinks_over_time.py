"""Kinks over time, which are known before: the steps of an adaptive method end there.

Tables and trajectories are functions of time in pieces. A step never reaches across the end of a
piece, so forces between two of its stages are as smooth as at the stages. On both sides of a kink
they are evaluated by the piece of that side: `Kinks.span` holds the times between which the stages
of a step are.

Steps of a fixed length do not end at all kinks, but often at some: a table has its rows at round
times, and so has the grid. Their stages are within the step by more than the rounding of t. So a
force that jumps where a step begins or ends has the value of the side of the step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Kinks
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


@inner
def until_kink(kinks: Kinks, t: float, left: float, h: float) -> float:
    """How long (s) a step from t (s) may be, at most `left` (s), and `kinks.span` of the step; h:
    the step of the grid."""
    instants, span = kinks.instants, kinks.span
    near = _SAME * h + _ROUNDED * abs(t)
    n = _first_behind(instants, t + near)
    span[0] = instants[n - ONE] if n > ZERO else -np.inf
    span[1] = np.inf
    if n < instants.size and instants[n] <= t + left + near:
        span[1] = instants[n] * _BEFORE
        if instants[n] < t + left - near:
            return instants[n] - t
    return left


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

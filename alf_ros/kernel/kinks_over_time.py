"""Kinks over time, which are known before: the steps of an adaptive method end there.

Tables and trajectories are functions of time in pieces. A step never reaches across the end of a
piece, so forces between two of its stages are as smooth as at the stages. On both sides of a kink
they are evaluated by the piece of that side: `Kinks.span` holds the times between which the stages
of a step are.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Kinks
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, inner

_SAME = 1e-12  # of the step of the grid, and …
_ROUNDED = 4e-15  # … of t: an instant that near to a time is that time
_BEFORE = 1.0 - 4e-16  # times an instant: just before it


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

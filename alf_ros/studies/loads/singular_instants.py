"""Efforts in singular positions: limits along the motion, interpolated from instants around.

In a singular position rows lose a direction, and the efforts of the motion are no longer the
solution of the equations there. They are the limits of their neighbours, if these have one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.simulation.sample_limits import lagrange_weights

# two grids of supports, in spacings: what they differ by estimates the error. They are not
# symmetric: both would take 0 for the limit at a pole that changes its sign
_ALL = np.array([-8.0, -6.0, -4.5, -3.0, 3.5, 5.0, 6.5, 7.5])
_OUTER = [0, 1, 2, 4, 6, 7]
_SIDE = 4  # supports on each side, of functions on a grid
_FINEST, _COARSER, _TRIES = 1e-4, 2.0, 9  # of the span of the motion: spacings that are tried
_AGREED = 1e-7  # of the largest effort, to which both grids agree


def limits(
    t: Floats, span: tuple[float, float], largest: Floats, read: Callable[[Floats], Floats]
) -> Floats:
    """(T, a) efforts at instants t (T,), s, as limits; NaN where there is none.

    span: the motion, s. largest (a,): the largest effort of each actuator. read: efforts (n, a) at
    instants (n,) that ascend; NaN in a singular position.
    """
    found = np.full((t.size, largest.size), np.nan)
    first, last = span
    spacing = _FINEST * (last - first)
    for _ in range(_TRIES):
        open_ = np.isnan(found).any(axis=1)
        open_ &= (t + spacing * _ALL[0] >= first) & (t + spacing * _ALL[-1] <= last)
        which = np.flatnonzero(open_)
        if which.size:
            at = t[which, None] + spacing * _ALL
            order = np.argsort(at, axis=None)
            values = np.empty((at.size, largest.size))
            values[order] = read(at.ravel()[order])
            for k, each in zip(which, values.reshape(*at.shape, -1), strict=True):
                found[k] = _agreed(spacing * _ALL, each, largest)
        spacing *= _COARSER
    return found


def filled(s: Floats, values: Floats, sizes: Floats) -> Floats:
    """(N, a) smooth functions of s (N,), ascending, with limits in place of NaN; NaN where there
    is none, or too little around. sizes (a,): what values are compared with, besides themselves.
    """
    found, known = values.copy(), np.flatnonzero(~np.isnan(values).any(axis=1))
    if known.size == 0:
        return found
    largest = np.maximum(sizes, np.abs(values[known]).max(axis=0))
    for k in np.flatnonzero(np.isnan(values).any(axis=1)):
        below = known[known < k][-_SIDE:]
        above = known[known > k][:_SIDE]
        if below.size == _SIDE and above.size == _SIDE:
            at = np.concatenate([below, above])
            found[k] = _agreed(s[at] - s[k], values[at], largest)
    return found


def _agreed(at: Floats, values: Floats, largest: Floats) -> Floats:
    """(a,) at 0, from values (supports, a) at the supports; NaN if in doubt."""
    if np.isnan(values).any():
        return np.full(largest.size, np.nan)
    fine = lagrange_weights(at, 0.0) @ values
    coarse = lagrange_weights(at[_OUTER], 0.0) @ values[_OUTER]
    agrees = np.abs(fine - coarse) <= _AGREED * np.maximum(largest, np.abs(values).max(axis=0))
    return np.where(agrees.all(), fine, np.nan)

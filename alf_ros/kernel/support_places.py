"""The eight support positions of an interpolated stage: their distances and weights.

Four are on either side of the stage, or of the singular position beside it, a spacing apart: -4,
-3, -2, -1, 1, 2, 3, 4. `Work.place_shift` is from the stage to their middle, in spacings.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Work
from alf_ros.kernel.numba_ext.jit import TWO, inner

PLACES = 8
_BETWEEN = 2.0  # spacings: two singular positions this close together are passed in one


@inner
def _offset(k: int) -> int:
    """-4, -3, -2, -1, 1, 2, 3, 4."""
    return k - 4 if k < 4 else k - 3


@inner
def apart(work: Work, k: int) -> float:
    """From the stage to place k, in parts of the spacing."""
    return _offset(k) + work.place_shift[0]


@inner
def _weight(k: int, at: float) -> float:
    """Weight of place k in Lagrange's interpolation at `at`, in spacings from their middle."""
    over, under = 1.0, 1.0
    for m in range(PLACES):
        if m != k:
            over *= at - _offset(m)
            under *= _offset(k) - _offset(m)
    return over / under


@inner
def weigh_places(work: Work, shift: float) -> None:
    """Weights of Lagrange's interpolation from places around `shift` to the stage; `shift` in
    parts of the spacing."""
    work.place_shift[0] = shift
    for k in range(PLACES):
        work.place_weights[k] = _weight(k, -shift)


@inner
def store_place(work: Work, k: int) -> None:
    """Position and velocity of place k."""
    n = work.p.size
    at = TWO * n * np.uint64(k)
    for a in range(n):
        work.places[at + a], work.places[at + n + a] = work.q[a], work.qd[a]


@inner
def position_of(work: Work) -> float:
    """About where the singular position is, from the distances x of the places: in parts of their
    spacing from the stage; 0 if x does not fall to about one place from either side, or if that is
    further from the stage than the first place."""
    x, nearest = work.place_x, 2
    for k in range(3, PLACES - 2):
        if x[k] < x[nearest]:
            nearest = k
    before, after = nearest - 1, nearest + 1
    fall, rise = x[before - 1] - x[before], x[after + 1] - x[after]
    if not (fall > 0.0 and rise > 0.0 and x[before] < np.inf and x[after] < np.inf):
        return 0.0
    wide = apart(work, before) - apart(work, before - 1)
    left = apart(work, before) + wide * x[before] / fall
    wide = apart(work, after + 1) - apart(work, after)
    right = apart(work, after) - wide * x[after] / rise
    found = 0.5 * (left + right)
    return found if abs(right - left) < _BETWEEN and abs(found) <= 1.0 else 0.0


@inner
def narrow_places(work: Work, position: float, spacing: float) -> None:
    """Interpolate places from those that stand in `work`, around `position` and with the distance
    `spacing` between them; both in parts of the present spacing, the position from the stage."""
    n, shift = work.p.size, work.place_shift[0]
    one = TWO * n
    two, three, four = one + one, one + one + one, one + one + one + one
    five, six, seven = four + one, four + two, four + three
    for a in range(one):
        old = (
            work.places[a],
            work.places[one + a],
            work.places[two + a],
            work.places[three + a],
            work.places[four + a],
            work.places[five + a],
            work.places[six + a],
            work.places[seven + a],
        )
        for k in range(PLACES):
            at = position + spacing * _offset(k) - shift  # from the middle of the old ones
            total = 0.0
            for m in range(PLACES):
                total += _weight(m, at) * old[m]
            work.places[np.uint64(k) * one + a] = total
    work.place_step[0] *= spacing
    weigh_places(work, position / spacing)

"""Whether a branch is left on the way from one posture to another: Φ_q v = s u changes its sign.

v is the softest mode of Φ_q, with the rows of the active coordinates, and u its unit image, with
s ≥ 0. On a branch both change little in a short step. In a dead point, and where branches cross, s
vanishes: behind it u or v, but not both, has the opposite direction. A step that jumps from one
branch to another, where the two nearly meet, shows the same.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.constraints import times_jacobian
from alf_ros.kernel.data import NOTHING
from alf_ros.kernel.data.closing import FACTORED, Closing
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.triangular_solve import solve

_ROUNDS = 3  # of the iteration with A⁻¹
_FRESH = 0.1  # of a mode, any other motion: the softest mode may be a new one
_ALIKE = 0.5  # cosine of two directions that are the same


@inner
def _find_mode(closing: Closing, start: Floats) -> None:
    """v and u at the factor in `work`, into `delta` and `w` there, by iteration from `start`."""
    system, work, n = closing.tight, closing.work, closing.ahead.size
    zero(work.delta)
    for a in range(n):
        work.delta[a] = start[a] + _FRESH * np.sin(1.0 + a) / np.sqrt(n)
    for _ in range(_ROUNDS):
        solve(closing.unit, system.pattern, work.diagonal, work.off, work.delta)
        square = NOTHING * NOTHING
        for a in range(n):
            square += work.delta[a] * work.delta[a]
        for a in range(n):
            work.delta[a] /= np.sqrt(square)
    times_jacobian(closing.unit, system.rows, work.gf, work.g2f, work.delta, work.w)
    square = NOTHING * NOTHING
    for r in range(work.w.size):
        work.w[r] *= np.sqrt(system.rows.alpha[r])
        square += work.w[r] * work.w[r]
    for r in range(work.w.size):
        work.w[r] /= np.sqrt(square)


@inner
def begin_mode(closing: Closing, q: Floats) -> None:
    """The mode at q is the one to compare with; `work` has Φ_q and the factor there."""
    linearise(closing.unit, closing.tight, closing.work, q)
    _find_mode(closing, closing.mode)
    copy(closing.work.delta, closing.mode)
    copy(closing.work.w, closing.image)


@inner
def is_left(closing: Closing) -> bool:
    """Whether the q in `work` is on another branch than the mode to compare with, for certain.

    Newton's method has ended at q last: the factor is the one where its last correction began.
    """
    work = closing.work
    if closing.counts[FACTORED] == 0:
        linearise(closing.unit, closing.tight, work, work.q)
    _find_mode(closing, closing.mode)
    motions, images = 0.0, 0.0
    for a in range(closing.ahead.size):
        motions += work.delta[a] * closing.mode[a]
    for r in range(work.w.size):
        images += work.w[r] * closing.image[r]
    sure = abs(motions) > _ALIKE and abs(images) > _ALIKE
    return sure and motions * images < 0.0

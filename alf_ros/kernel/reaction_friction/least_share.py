"""The λ of least norm of rows that depend on others, without what rounding adds.

No motion feels such a part of λ, so no solve removes it: each round adds the part of the residual
r2 that rounding leaves open, times α. Loads of friction feel it, and would never agree closer.
"""

from __future__ import annotations

from alf_ros.kernel.augmented_solve import finish
from alf_ros.kernel.data import EVERY_MODE, SOLVED, Problem
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, zero


@inner
def take_least_share(problem: Problem) -> None:
    """Take the part of y in `work` that no motion feels out of it.

    Conjugate residuals close rows that are open by α⁻¹ y. That part, over α, stays open.
    """
    system, work = problem.system, problem.work
    cut, alpha = problem.forces.bearings, problem.system.rows.alpha
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    zero(cut.qdd_of)
    for r in range(alpha.size):
        work.r2[r] = work.y[r] / alpha[r]
    finish(problem.unit, system, work, cut.qdd_of, SOLVED, EVERY_MODE)
    for r in range(alpha.size):
        work.y[r] = cut.kept_y[r] - alpha[r] * work.r2[r]
    copy(cut.kept_r2, work.r2)

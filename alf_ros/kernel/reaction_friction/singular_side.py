"""On which side of a singular position the mechanism is, as far as friction feels the position.

The combination of rows nearest to losing its direction is opened by a velocity. Beyond a singular
position the same opening takes the opposite velocity.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.augmented_solve import solved_anew
from alf_ros.kernel.constraints import times_jacobian
from alf_ros.kernel.data import Problem
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.reaction_friction.cut_reactions import reactions
from alf_ros.kernel.reaction_friction.load_response import unit_friction

_ROUNDS = 2  # of inverse iteration for the softest combination of rows
_NEAR = 0.3  # of its opening where the step begins: below it may have passed zero
_COUPLED = 1e-9  # gain by a combination of rows that friction feels


@inner
def find_softest(problem: Problem, exactly: bool) -> None:
    """The combination of rows nearest to losing its direction, where a step begins.

    By inverse iteration, from a velocity that has a part in every mode.
    """
    unit, system, work = problem.unit, problem.system, problem.work
    cut = problem.forces.bearings
    rows, m = system.rows, system.rows.alpha.size
    cut.branch[0] = 0.0
    if m == 0:
        return
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    zero(cut.across)
    for i in range(work.p.size):
        cut.across[i] = 0.3 + (i * 7919 % 1009) / 1009.0
    times_jacobian(unit, rows, work.g, work.g2, cut.across, work.r2)
    for _ in range(_ROUNDS):
        size = largest(work.r2, m)
        for r in range(m):
            work.r2[r] /= size
            cut.softest[r] = rows.alpha[r] * work.r2[r]
        opened = 0.0
        for r in range(m):
            opened += cut.softest[r] * work.r2[r]
        _open(problem, exactly)
        copy(cut.qdd_of, cut.across)
        cut.branch[0] = opened
        for r in range(m):
            work.r2[r] = -work.y[r] / rows.alpha[r]
    if not np.isfinite(largest(cut.across, work.p.size) * cut.branch[0]):
        cut.branch[0] = 0.0
    copy(cut.kept_y, work.y)
    copy(cut.kept_r2, work.r2)


@inner
def side(problem: Problem, t: float, exactly: bool) -> int:
    """-1 if a singular position that friction feels lies between here and where the step began,
    else 1; 0 where a solve is slow and not to be finished, see `solved`."""
    unit, system, work = problem.unit, problem.system, problem.work
    cut, rows = problem.forces.bearings, system.rows
    if not cut.branch[0] > 0.0:
        return 1
    times_jacobian(unit, rows, work.g, work.g2, cut.across, work.w)
    opened = 0.0
    for r in range(rows.alpha.size):
        opened += cut.softest[r] * work.w[r]
    if opened > _NEAR * cut.branch[0]:
        return 1
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    for r in range(rows.alpha.size):
        work.r2[r] = cut.softest[r] / rows.alpha[r]
    sign = 1 if _open(problem, exactly) else 0
    zero(work.delta)
    add_mass_times(unit, system.mass, 1.0, cut.qdd_of, work.delta)
    same, norm, felt, power = 0.0, 0.0, 0.0, 0.0
    for i in range(work.p.size):
        same += work.delta[i] * cut.across[i]
        norm += work.delta[i] * cut.qdd_of[i]
    if sign == 1 and same < 0.0:
        zero(cut.next)
        zero(work.Q)
        reactions(problem, t, work.Q, cut.next, False)
        felt = largest(cut.answer, cut.answer.size)
        for m in range(cut.trial.size):
            if unit_friction(problem, t, m):
                total = 0.0
                for i in range(work.p.size):
                    total += work.Q[i] * cut.qdd_of[i]
                power = max(power, abs(total))
        if felt * power > _COUPLED * norm:
            sign = -1
    copy(cut.kept_y, work.y)
    copy(cut.kept_r2, work.r2)
    return sign


@inner
def _open(problem: Problem, exactly: bool) -> bool:
    """The least velocity that opens the rows by r2, in `qdd_of`, and its multipliers in `work.y`.

    Returns False where the solve is slow and not to be finished.
    """
    work, cut = problem.work, problem.forces.bearings
    zero(work.Q)
    zero(cut.qdd_of)
    zero(work.y)
    _, sigma = solved_anew(problem, work.Q, cut.qdd_of, exactly)  # (33)
    return sigma > 0.0 or exactly

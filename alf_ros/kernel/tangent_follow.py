"""Tangents beside a step, as long as no stage of it is beside a singular position.

    for each stage:  q, q̇, q̈, λ and the factor of the stage, as in `step`
        for each group of parameters:
            δq, δq̇ = those of the begin + h Σ_m a_sm (rates)_m    # unfold_tangents
            or, along arcs, δq and δp, and from these δq̇          # project_tangents
            δq̈                                                    # differentiate
            rates of δq, δq̇                                       # fold_tangents
    at the end, δq and δq̇ onto their constraints, along M         # `tangent_step`

Nothing that the step reads is written here, so the step has the same bits.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, Problem, Tangents
from alf_ros.kernel.driven_tangents import drive_all_tangents
from alf_ros.kernel.numba_ext.jit import TWO, expanded, inner
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.step_tape import store_multipliers
from alf_ros.kernel.tangent_arcs import adds_arcs
from alf_ros.kernel.tangent_axes import (
    begin_tangents,
    fold_tangents,
    take_first_tangents,
    unfold_tangents,
)
from alf_ros.kernel.tangent_lane_solve import LEAVE
from alf_ros.kernel.tangent_stage import differentiate, project_tangents


@expanded
def begin_following(tangents: Tangents, problem: Problem, phase: Phase, begun: bool) -> None:
    """Begin a step from `phase`, with its arcs chosen; `begun`: stage 0 is of a step that was
    too long."""
    begin_tangents(tangents, problem, phase, False)
    tangents.followed[1] = 1
    if not begun:
        tangents.followed[0] = 1
        return
    take_first_tangents(tangents, problem)
    copy(tangents.first_qdd, tangents.qdd)
    fold_tangents(tangents, problem, np.uint64(0))


@inner
def is_followed(tangents: Tangents) -> bool:
    """Whether all stages of the step so far were followed."""
    return tangents.followed[0] != 0 and tangents.followed[1] != 0


@inner
def follow_sums(tangents: Tangents, problem: Problem, t: float, s: np.uint64, h: float) -> None:
    """δq and δq̇ of stage s at t (s), as the step adds them up; see `unfold_tangents`."""
    if s == 0 and adds_arcs(tangents):
        take_first_tangents(tangents, problem)
        drive_all_tangents(tangents, t)
    else:
        unfold_tangents(tangents, problem, t, s, h)


@expanded
def follow_stage(tangents: Tangents, problem: Problem, t: float, s: np.uint64, x: float) -> None:
    """The rates of stage s, as the step leaves it; x: its distance to a singular position."""
    if x < np.inf:
        tangents.followed[min(s, np.uint64(1))] = 0
    if not is_followed(tangents):
        return
    if s > 0:  # of the first stage they are stored already
        store_multipliers(tangents.lam, problem.work.y)
    follow_sums(tangents, problem, t, s, problem.work.interval[TWO])
    if s > 0 and adds_arcs(tangents):
        if not project_tangents(tangents, problem, tangents.here, LEAVE):
            tangents.followed[1] = 0
            return
    differentiate(tangents, problem, tangents.here, t, LEAVE)
    if s == 0:
        copy(tangents.qdd, tangents.first_qdd)
    fold_tangents(tangents, problem, s)

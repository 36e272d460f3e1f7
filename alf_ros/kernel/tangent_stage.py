"""Derivatives by all parameters at a stage, regular or beside a singular position.

At a distance x from a singular position, rounding e turns δq by e / x, δq̇ by e / x² and δq̈ by
e / x³: two powers of x more than the motion. Derivatives along the branch are smooth there, also
through the position. So a stage beside the position is interpolated from support positions, like a
stage of the motion that is too close (`interpolated_stages`), but from support positions that lie
further apart, and around the position. Each support position gives δq, δq̇ and δq̈. Forces and
their derivatives are evaluated once, at the stage.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.augmented_solve import apply
from alf_ros.kernel.data import FollowedStage, Phase, Problem, Scales, Tangents, Work
from alf_ros.kernel.driven_tangents import drive_all_tangents
from alf_ros.kernel.interpolated_stages import SLOW, evaluate_place, place_at
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import ONE, inner
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage
from alf_ros.kernel.step_tape import INTERPOLATED, PROJECTED, store_multipliers
from alf_ros.kernel.support_places import PLACES, apart, store_place, weigh_places
from alf_ros.kernel.tangent_arcs import adds_arcs
from alf_ros.kernel.tangent_lane_solve import FINISH
from alf_ros.kernel.tangent_solves import (
    accelerate_tangents,
    begin_rates,
    begin_stage,
    change_forces,
    group_of,
    project_position,
    project_velocity,
    velocity_of_momentum,
)

# spacing of the support positions, in parts of the radius of the path: rounding leaves
# ε / x³ = 7e-11 of a derivative there, and the interpolation 600 x⁸ = 2e-12
_SPACING = 0.015
_CLEAR = 0.5  # spacings: the least distance x of a support position from the singular position
_WIDER = 1.4
_TRIES = 8


@inner
def differentiate_beside(
    tangents: Tangents, phase: Phase, t: float, scales: Scales, clear: bool
) -> tuple[int, int]:
    """δq̈ of all parameters at a stage beside a singular position; the iterations, and how they are
    computed, see `step_tape`.

    The stage as the step adds it up stands in `base`, `along` and p of `work`; q and q̇ of the
    stage in `sum_q` and `sum_qd`. From rest, and where no support positions are found, a stage
    that is `clear` of the position is taken as it is.
    """
    problem = tangents.problem
    system, work = problem.system, problem.work
    if largest(phase.qd, work.p.size) > SLOW * scales.falling:
        if _find_places(problem, t, scales) > 0:
            return _differentiate_places(tangents, t), INTERPOLATED
    if not clear:
        return 0, PROJECTED
    prescribe(system, t, work.q, work.qd, work.qdd)
    copy(work.base, work.q)
    copy(work.base, work.target)
    count, _x, _clear = stage(problem, t, scales, True, True)
    if count > 0:
        store_multipliers(tangents.lam, work.y)
        count = differentiate_projected(tangents, t)
    return count, PROJECTED


@inner
def _find_places(problem: Problem, t: float, scales: Scales) -> int:
    """Position and velocity of the support positions along the branch; the iterations, or 0 if
    not all of them are clear of the singular position."""
    work = problem.work
    n, spacing, position, count = work.p.size, _SPACING * scales.radius, 0.0, 1
    limits = Scales(scales.radius, _CLEAR * _SPACING, scales.falling)
    for turn in range(_TRIES):
        step, good = spacing / largest(work.along, n), True
        work.place_step[0] = step
        weigh_places(work, position)
        for k in range(PLACES):
            away = step * apart(work, k)
            prescribe(problem.system, t + away, work.q, work.qd, work.qdd)
            for a in range(n):
                place = work.base[a] + away * (work.along[a] + 0.5 * away * work.bend[a])
                work.q[a], work.target[a] = place, place
            count, work.place_x[k], clear = stage(problem, t, limits, True, False)
            if count <= 0:
                return count
            good = good and clear
            store_place(work, k)
        if good:
            return count
        position = _singular_place(work)
        if turn > 0:
            spacing, position = _WIDER * spacing, position / _WIDER
    return 0


@inner
def _singular_place(work: Work) -> float:
    """About where the singular position is, in spacings from the stage: x is proportional to the
    distance from the position."""
    x, nearest = work.place_x, 0
    for k in range(1, PLACES):
        if x[k] < x[nearest]:
            nearest = k
    here = apart(work, nearest)
    before, after = np.inf, np.inf
    if nearest > 0:
        before = x[nearest - 1]
    if nearest < PLACES - 1:
        after = x[nearest + 1]
    side = nearest + 1 if after < before else nearest - 1
    far = nearest - 1 if after < before else nearest + 1
    if not min(before, after) < np.inf:
        return here
    wide = abs(apart(work, side) - here)
    slope = (x[nearest] + x[side]) / wide  # if the position lies between both
    if 0 <= far < PLACES and x[far] < np.inf:
        slope = (x[far] - x[nearest]) / abs(apart(work, far) - here)
    shift = min(x[nearest] / slope, 0.5 * wide) if slope > 0.0 else 0.0
    return here + shift if side > nearest else here - shift


@inner
def project_tangents(
    tangents: Tangents, problem: Problem, at: FollowedStage, slow_modes: np.uint64
) -> bool:
    """δq and δq̇ onto their constraints, at q, q̇ of the stage, or δq̇ from δp, at its σ.

    `slow_modes` and the result are as for `tangent_lane_solve.solved_together`.
    """
    good = True
    begin_rates(tangents, problem, at)
    for k in range(tangents.groups):
        if good:
            good = project_position(tangents, problem, at, k, slow_modes)
        if good and adds_arcs(tangents):
            good = velocity_of_momentum(tangents, problem, at, k, slow_modes)
        elif good:
            good = project_velocity(tangents, problem, at, k, slow_modes)
    return good


@inner
def differentiate(
    tangents: Tangents, problem: Problem, at: FollowedStage, t: float, slow_modes: np.uint64
) -> None:
    """δq̈ of all parameters at a stage of `problem`; `slow_modes` is as for
    `tangent_lane_solve.solved_together`."""
    begin_stage(tangents, problem, at)
    for k in range(tangents.groups):
        change_forces(tangents, at, k, t)
        accelerate_tangents(tangents, problem, at, k, slow_modes)


@inner
def differentiate_projected(tangents: Tangents, t: float) -> int:
    """The same at the stage in the workspace of the tangents, after δq and δq̇ are projected; 0 if
    it is not determined."""
    problem, at = tangents.problem, tangents.behind
    if not linearise(problem.unit, problem.system, problem.work, problem.work.q):
        return 0
    project_tangents(tangents, problem, at, FINISH)
    differentiate(tangents, problem, at, t, FINISH)
    return 1


@inner
def _differentiate_places(tangents: Tangents, t: float) -> int:
    """The same of a stage that is interpolated from the support positions in `work`."""
    problem, at = tangents.problem, tangents.behind
    unit, system, work = problem.unit, problem.system, problem.work
    n, whole, places = work.p.size, work.q.size, np.uint64(PLACES)
    copy(tangents.q, tangents.begun_q)
    copy(tangents.qd, tangents.begun_qd)
    zero(tangents.whole_q)
    zero(tangents.whole_qd)
    zero(tangents.whole_qdd)
    for k in range(tangents.groups):  # fixed blocks stay as they are, and where drives put them
        for a in range(k * whole + n, (k + ONE) * whole):
            tangents.whole_q[a], tangents.whole_qd[a] = tangents.q[a], tangents.qd[a]
            if tangents.drive.size > 0:
                tangents.whole_qdd[a] = tangents.drive_qdd[a]
    # δq and δq̇
    for p in range(places):
        place_at(problem, t, p)
        if not linearise(unit, system, work, work.q):
            return 0
        _project_begun(tangents, t + work.place_step[0] * apart(work, p))
        _add_up(tangents, tangents.q, tangents.whole_q, work.place_weights[p])
        _add_up(tangents, tangents.qd, tangents.whole_qd, work.place_weights[p])
    # δq̈, under the forces that act at the stage and their change there
    prescribe(system, t, work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    apply(problem, t)
    copy(work.Q, work.given)
    copy(tangents.whole_q, tangents.q)
    copy(tangents.whole_qd, tangents.qd)
    for k in range(tangents.groups):
        change_forces(tangents, at, k, t)
        copy(tangents.f, group_of(tangents, tangents.pushed, k))
    for p in range(places):
        if evaluate_place(problem, t, p) <= 0:
            return 0
        store_multipliers(tangents.lam, work.y)
        _project_begun(tangents, t + work.place_step[0] * apart(work, p))
        begin_stage(tangents, problem, at)
        for k in range(tangents.groups):
            copy(group_of(tangents, tangents.pushed, k), tangents.f)
            accelerate_tangents(tangents, problem, at, k, FINISH)
        _add_up(tangents, tangents.qdd, tangents.whole_qdd, work.place_weights[p])
    copy(tangents.whole_q, tangents.q)
    copy(tangents.whole_qd, tangents.qd)
    copy(tangents.whole_qdd, tangents.qdd)
    return 1


@inner
def _project_begun(tangents: Tangents, t: float) -> None:
    """δq and δq̇ as the step adds them up, onto the constraints at q, q̇ in `work`, at t (s)."""
    copy(tangents.begun_q, tangents.q)
    copy(tangents.begun_qd, tangents.qd)
    drive_all_tangents(tangents, t)
    project_tangents(tangents, tangents.problem, tangents.behind, FINISH)


@inner
def _add_up(tangents: Tangents, u: Lanes, total: Lanes, weight: float) -> None:
    """Add `weight` times u (groups, all blocks D) to the total of the movable blocks."""
    n, whole = tangents.problem.work.p.size, tangents.Q.size
    for k in range(tangents.groups):
        for a in range(k * whole, k * whole + n):
            total[a] += weight * u[a]

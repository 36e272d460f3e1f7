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

from alf_ros.arrays import Floats
from alf_ros.kernel.augmented_solve import apply
from alf_ros.kernel.data import Phase, Problem, Scales, Tangents, Work
from alf_ros.kernel.interpolated_stages import (
    PLACES,
    SLOW,
    apart,
    evaluate_place,
    place_at,
    store_place,
    weigh_places,
)
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage
from alf_ros.kernel.step_tape import INTERPOLATED, PROJECTED
from alf_ros.kernel.tangent_solves import (
    accelerate_tangent,
    add_force_change,
    project_position,
    project_velocity,
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
        count = differentiate(tangents, t, True)
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
def take(tangents: Tangents, k: np.uint64, q: Floats, qd: Floats) -> None:
    """δq and δq̇ of parameter k, of q and qd (K, all blocks D), into `dq` and `dqd`."""
    whole = tangents.dq.size
    for a in range(whole):
        tangents.dq[a], tangents.dqd[a] = q[k * whole + a], qd[k * whole + a]


@inner
def project_tangents(tangents: Tangents) -> int:
    """δq and δq̇ onto their constraints, at q, q̇ in `work`; the iterations."""
    whole, count = tangents.dq.size, 1
    for k in range(tangents.count):
        take(tangents, k, tangents.q, tangents.qd)
        if count > 0:
            count = project_position(tangents, k, True)
        if count > 0:
            count = project_velocity(tangents, k, True)
        for a in range(whole):
            tangents.q[k * whole + a] = tangents.dq[a]
            tangents.qd[k * whole + a] = tangents.dqd[a]
    return count


@inner
def store_multipliers(tangents: Tangents) -> None:
    """-λ of the stage, from where it was solved for."""
    work = tangents.problem.work
    for r in range(work.y.size):
        tangents.lam[r] = -work.y[r]


@inner
def differentiate(tangents: Tangents, t: float, near: bool) -> int:
    """δq̈ of all parameters at the stage in `work`; the iterations.

    `near`: δq and δq̇ are projected before.
    """
    problem = tangents.problem
    work, whole, count = problem.work, tangents.dq.size, 1
    store_multipliers(tangents)
    if near:
        if not linearise(problem.unit, problem.system, work, work.q):
            return 0
        count = project_tangents(tangents)
    for k in range(tangents.count):
        if count > 0:
            take(tangents, k, tangents.q, tangents.qd)
            count = accelerate_tangent(tangents, k, t, near, True)
            for a in range(whole):
                tangents.qdd[k * whole + a] = tangents.x[a]
    return count


@inner
def _differentiate_places(tangents: Tangents, t: float) -> int:
    """The same of a stage that is interpolated from the support positions in `work`."""
    problem = tangents.problem
    unit, system, work = problem.unit, problem.system, problem.work
    n, whole, places = work.p.size, tangents.dq.size, np.uint64(PLACES)
    many = tangents.count * whole
    for a in range(many):
        tangents.begun_q[a], tangents.begun_qd[a] = tangents.q[a], tangents.qd[a]
        tangents.qdd[a] = 0.0
    # δq and δq̇
    for k in range(tangents.count):
        for a in range(n):
            tangents.q[k * whole + a], tangents.qd[k * whole + a] = 0.0, 0.0
    for p in range(places):
        place_at(problem, t, p)
        if not linearise(unit, system, work, work.q):
            return 0
        for k in range(tangents.count):
            if _project_begun(tangents, k) <= 0:
                return 0
            for a in range(n):
                tangents.q[k * whole + a] += work.place_weights[p] * tangents.dq[a]
                tangents.qd[k * whole + a] += work.place_weights[p] * tangents.dqd[a]
    # δq̈, under the forces that act at the stage and their change there
    prescribe(system, t, work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    apply(problem, t)
    copy(work.Q, work.given)
    for k in range(tangents.count):
        take(tangents, k, tangents.q, tangents.qd)
        zero(tangents.f)
        add_force_change(tangents, k, t)
        for a in range(whole):
            tangents.pushed[k * whole + a] = tangents.f[a]
    for p in range(places):
        if evaluate_place(problem, t, p) <= 0:
            return 0
        store_multipliers(tangents)
        for k in range(tangents.count):
            if _project_begun(tangents, k) <= 0:
                return 0
            for a in range(whole):
                tangents.f[a] = tangents.pushed[k * whole + a]
            if accelerate_tangent(tangents, k, t, True, False) <= 0:
                return 0
            for a in range(n):
                tangents.qdd[k * whole + a] += work.place_weights[p] * tangents.x[a]
    return 1


@inner
def _project_begun(tangents: Tangents, k: np.uint64) -> int:
    """δq and δq̇ of parameter k as the step adds them up, onto the constraints at q, q̇ in `work`;
    the iterations."""
    take(tangents, k, tangents.begun_q, tangents.begun_qd)
    count = project_position(tangents, k, True)
    return project_velocity(tangents, k, True) if count > 0 else count

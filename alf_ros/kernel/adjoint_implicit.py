"""The adjoint of a run of an implicit method: the steps of its tangents (`implicit_tangents`),
transposed.

A pass of the tangents gives δk' = A δk + B (δq_b, δv_b) + G δθ, and they solve δk = δk'. With x̄ =
∂J/∂δk and w = x̄ + Aᵀ w, ∂J/∂(δq_b, δv_b) is Bᵀ w and ∂J/∂θ is Gᵀ w. A transposed pass from a
vector z gives Aᵀ z and Bᵀ z, and adds Gᵀ z to the sums. So w is found by the same Krylov method.
All three products are linear in z: the last pass begins with w less the sum of all z before it, so
that the passes together give Bᵀ w and Gᵀ w.

A step is taken again from its last stage to its first, in another workspace than the run's: the k
are known, so that each stage is one evaluation.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.adjoint_forces import read_trace_back, trace_stage
from alf_ros.kernel.adjoint_solves import accelerate_back
from alf_ros.kernel.adjoint_stage import take_projections_back
from alf_ros.kernel.adjoint_sums import take_fixed_back, take_sum_back
from alf_ros.kernel.conjugate_residuals import MOST, RESTARTS, step_along
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.driven_tangents import take_drives_back
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.implicit_stages import evaluate_again, evaluate_begin, place_stage
from alf_ros.kernel.kinks_over_time import stage_time
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, compiled, inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.status import NO_ROOM, OK, UNFOLLOWED
from alf_ros.kernel.step_tape import (
    BEGIN,
    END,
    LENGTH,
    REGULAR,
    SPAN,
    restore_rates,
    restore_stage,
    restore_step,
    store_stage,
)

_ENOUGH = 1e-14  # residual of w that is left, of its largest number
_ROUNDING = 1e-9  # what may be rounding, where it becomes no less
_NOTHING = 1e-100  # of ∂J/∂δk: squares of less would not be numbers


@compiled
def take_implicit_steps_back(adjoint: Adjoint, last: int, first: int) -> int:
    """Like `take_steps_back`. Beside a singular position steps are not taken back."""
    for back in range(last + 1 - first):
        adjoint.at[0] = last - back
        result = _take_step_back(adjoint, np.uint64(last - back))
        if result != OK:
            return result
    return OK


@inner
def _take_step_back(adjoint: Adjoint, k: np.uint64) -> int:
    """Step k."""
    tangents, record, phase = adjoint.tangents, adjoint.record, adjoint.phase
    problem, rates = tangents.problem, adjoint.rates
    method, work = problem.method, problem.work
    n, stages, first = work.p.size, method.b.size, k * np.uint64(SPAN)
    t, end = record.span[first + np.uint64(BEGIN)], record.span[first + np.uint64(END)]
    h = record.span[first + np.uint64(LENGTH)]
    if record.regular[k] == 0:
        return UNFOLLOWED
    restore_step(record, k, phase)
    restore_rates(record, work, stages, k)
    result, x = evaluate_begin(problem, phase, t, tangents.lam)
    if result != OK:
        return result
    scales = scales_of(problem.system, work, phase, False)
    store_stage(adjoint.tape, tangents, ZERO, REGULAR)
    zero(adjoint.start)
    zero(rates)
    place_stage(problem, phase, work.k, (end, h), stages - ONE)  # the end has its M̂
    if _take_end_back(adjoint, k, end) <= 0:
        return UNFOLLOWED
    _move_back(adjoint, h * method.a[stages * stages - ONE])
    for back in range(stages - ONE):
        s = stages - ONE - back
        at, gamma = TWO * s * n, h * method.a[s * stages + s]
        ts, near = stage_time(t, end, h, method.c[s]), x < np.inf
        result, x = evaluate_again(problem, phase, work.k, (ts, h), s, scales, near, tangents.lam)
        if result != OK:
            return result
        for a in range(n):
            adjoint.begun_qd[a] += rates[at + a]
            adjoint.x[a] += rates[at + n + a] + gamma * rates[at + a]
        if not trace_stage(adjoint, ts):
            return NO_ROOM
        if not _solve_back(adjoint, ts, gamma):
            return UNFOLLOWED
        take_sum_back(adjoint, adjoint.begun_q, adjoint.begun_qd, s, h)
        _begin_stage_back(adjoint)
    return _take_begin_back(adjoint, t, h)


@inner
def _take_end_back(adjoint: Adjoint, k: np.uint64, end: float) -> int:
    """∂J/∂(q, q̇) of the end of step k, in `bar_q` and `bar_qd`, into the same before its
    projections, in `q` and `qd`. 0 or less if it is not determined."""
    problem, record = adjoint.tangents.problem, adjoint.record
    work, whole = problem.work, adjoint.q.size
    copy(section(record.ended_q, k * whole, whole), work.q)
    copy(section(record.ended_qd, k * whole, whole), work.qd)
    if not linearise(problem.unit, problem.system, work, work.q):
        return 0
    copy(adjoint.bar_q, adjoint.q)
    copy(adjoint.bar_qd, adjoint.qd)
    zero(adjoint.qdd)
    count = take_projections_back(adjoint)
    take_drives_back(adjoint, end)
    for a in range(work.p.size, whole):
        adjoint.bar_q[a], adjoint.bar_qd[a] = 0.0, 0.0
    _begin_stage_back(adjoint)
    return count


@inner
def _take_begin_back(adjoint: Adjoint, t: float, h: float) -> int:
    """∂J/∂ the rates of the first stage, which is explicit and stands on the tape, into ∂J/∂(q, q̇)
    of the begin of the step, in `bar_q` and `bar_qd`. Returns the result."""
    tangents, rates, start = adjoint.tangents, adjoint.rates, adjoint.start
    problem, work = tangents.problem, tangents.problem.work
    n = work.p.size
    zero(problem.system.soft.weight)
    restore_stage(adjoint.tape, tangents, ZERO)
    if not linearise(problem.unit, problem.system, work, work.q):
        return UNFOLLOWED
    _begin_pass_back(adjoint, section(rates, n, n))
    for a in range(n):
        adjoint.qd[a] = rates[a]
    if not trace_stage(adjoint, t):
        return NO_ROOM
    if not _differentiate_back(adjoint):
        return UNFOLLOWED
    take_drives_back(adjoint, t)
    take_fixed_back(adjoint)
    take_sum_back(adjoint, adjoint.q, adjoint.qd, ZERO, h)
    for a in range(n):
        adjoint.bar_q[a], adjoint.bar_qd[a] = start[a], start[n + a]
    return OK


@inner
def _begin_stage_back(adjoint: Adjoint) -> None:
    """∂J/∂ of a stage: none yet."""
    zero(adjoint.begun_q)
    zero(adjoint.begun_qd)
    zero(adjoint.x)


@inner
def _move_back(adjoint: Adjoint, gamma: float) -> None:
    """∂J/∂(δq, δq̇) behind `_move` of the tangents, in `q` and `qd`, added to ∂J/∂(δq_b, δv_b), in
    `begun_q` and `begun_qd`, and to ∂J/∂δk, in `x`."""
    take_fixed_back(adjoint)
    for a in range(adjoint.tangents.problem.work.p.size):
        v = adjoint.qd[a] + gamma * adjoint.q[a]
        adjoint.begun_q[a] += adjoint.q[a]
        adjoint.begun_qd[a] += v
        adjoint.x[a] += gamma * v


@inner
def _begin_pass_back(adjoint: Adjoint, w: Floats) -> None:
    """∂J/∂δq̈ = w (n,), and ∂J/∂(δq, δq̇) = 0."""
    zero(adjoint.q)
    zero(adjoint.qd)
    zero(adjoint.qdd)
    for a in range(w.size):
        adjoint.qdd[a] = w[a]


@inner
def _differentiate_back(adjoint: Adjoint) -> bool:
    """∂J/∂δq̈ at the stage in `work`, in `qdd`, added to ∂J/∂(δq, δq̇) there, in `q` and `qd`, by
    the trace of its forces; ∂J/∂δQ is in `u`. False if it is not determined."""
    if accelerate_back(adjoint) <= 0:
        return False
    read_trace_back(adjoint, adjoint.u, adjoint.q, adjoint.qd)
    return True


@inner
def _pass_back(adjoint: Adjoint, t: float, gamma: float, w: Floats) -> bool:
    """A pass of the tangents, transposed: Aᵀ w into `x`, Bᵀ w added to `begun_q` and `begun_qd`,
    and Gᵀ w to the sums. False if it is not determined."""
    problem = adjoint.tangents.problem
    n = problem.work.p.size
    _begin_pass_back(adjoint, section(w, ZERO, n))
    if not _differentiate_back(adjoint):
        return False
    zero(adjoint.x)
    add_soft_times(problem.unit, problem.system.soft, 1.0, adjoint.u, adjoint.x)
    if take_projections_back(adjoint) <= 0:
        return False
    take_drives_back(adjoint, t)
    _move_back(adjoint, gamma)
    return True


@inner
def _solve_back(adjoint: Adjoint, t: float, gamma: float) -> bool:
    """∂J/∂δk of the stage in `work`, in `x`, into ∂J/∂(δq_b, δv_b), added to `begun_q` and
    `begun_qd`, and into the sums; whether w is found. Needs the trace of the stage."""
    n, image = adjoint.tangents.problem.work.p.size, adjoint.x
    w, r, passed = adjoint.whole_q, adjoint.whole_qd, adjoint.pushed
    total = adjoint.whole_qdd
    zero(w)
    zero(passed)  # the sum of what passes began with
    copy(image, r)
    copy(image, total)  # x̄ + Aᵀ of that sum
    before, size = np.inf, largest(r, n)
    if size < _NOTHING:
        return True
    for _ in range(RESTARTS):
        for j in range(MOST):
            if not _pass_back(adjoint, t, gamma, r):
                return False
            for a in range(n):
                passed[a] += r[a]
                total[a] += image[a]
                image[a] = r[a] - image[a]
            left = step_along(adjoint.search, n, j, w, r, image)
            if left <= _ENOUGH * max(size, largest(w, n)):
                break
        for a in range(n):
            r[a] = w[a] - passed[a]
            passed[a] += r[a]
        if not _pass_back(adjoint, t, gamma, r):
            return False
        for a in range(n):
            total[a] += image[a]
            r[a] = total[a] - w[a]
        left, size = largest(r, n), max(size, largest(w, n))
        if left <= 10.0 * _ENOUGH * size or (left > 0.1 * before and left <= _ROUNDING * size):
            return True
        before = left
    return False

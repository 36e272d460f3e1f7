"""The derivatives of q and q̇ by parameters, carried through a step of an implicit method.

A stage solves M k + Φ_qᵀ λ = Q(q, v) at q = q_b + hγ v, v = v_b + hγ k (`implicit`). So δk solves

    M δk + Φ_qᵀ δλ = δQ - δM k - (δΦ_q)ᵀ λ    at δv = δv_b + hγ δk, δq = δq_b + hγ δv

with the constraints of `tangent_solves`. M̂ has most of what δQ gets by way of δk, so passes
M̂ δk' + … = … + (M̂ - M) δk are mostly close to δk soon.

The step is taken again behind the run, where it left off: its k are known, so that each stage is
one evaluation. The run itself has the bits that it has without tangents.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from alf_ros.kernel.companion import BEGIN_CALL, END_STEP, told
from alf_ros.kernel.conjugate_residuals import MOST, RESTARTS, step_along
from alf_ros.kernel.data import Phase, Problem, Tangents
from alf_ros.kernel.driven_tangents import drive_tangents
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.implicit_stages import evaluate_again, evaluate_begin
from alf_ros.kernel.kinks_over_time import stage_time
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, by_address, expanded, inner
from alf_ros.kernel.numba_ext.lane_numbers import everywhere, pick
from alf_ros.kernel.numba_ext.lane_structs import lane, lanes_of
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.status import OK, UNFOLLOWED
from alf_ros.kernel.tangent_axes import accept_tangents, read_tangents
from alf_ros.kernel.tangent_lane_solve import FINISH, LEAVE
from alf_ros.kernel.tangent_solves import (
    accelerate_tangents,
    begin_stage,
    change_forces,
    group_of,
    project_position,
    project_velocity,
)
from alf_ros.kernel.tangent_stage import differentiate, project_tangents

_PART = 1e-12  # of the residual that is left before it is computed anew
# residual of δk that is left, of δk, and of δq̇ / hγ, δq / (hγ)² and what forces do to the masses
_CONVERGED, _TINY = 1e-14, 1e-17
_ROUNDED = 30.0  # times that: what rounding may leave of it, where it was less in the search
_ROUNDING, _NOISE = 1e-9, 1e-11  # what may be rounding, where it becomes no less
_CLOSE = 0.1  # residual of a first guess, of δk, from which a search is accurate to rounding
_UNSEEN = 0.2  # times what is left: a residual behind a pass that is not made
_ABOVE = 1e3  # times what is left: residuals that show what passes leave of them


def _follow(
    tangents: Tangents,
    problem: Problem,
    phase: Phase,
    what: np.uint64,
    s: np.uint64,
    t: float,
    x: float,
) -> int:
    """The companion of the steps of an implicit method."""
    if what == BEGIN_CALL:
        read_tangents(tangents, phase)
    elif what == END_STEP:
        return _carry(tangents, problem, phase)
    return OK


@cache
def following_implicitly(dimension: int, lanes: int) -> Any:
    """`tangent_step.following`, of an implicit method."""
    tangents = Tangents._numba_type(dimension, lanes)
    return by_address(told(tangents, dimension))(_follow)


@expanded
def _carry(tangents: Tangents, problem: Problem, phase: Phase) -> int:
    """The tangents of `phase`, where a step of `problem` began, to its end.

    The step ended in the workspace of `problem`. Returns the result; if it is not OK the tangents
    are as before. Beside a singular position they are not followed.
    """
    run, own = problem.work, tangents.problem
    unit, system, method, work = own.unit, own.system, own.method, own.work
    stages, interval = method.b.size, run.interval
    t, end, h = interval[ZERO], interval[ONE], interval[TWO]
    if run.aside[0] != 0 or run.aside[1] != 0:
        return UNFOLLOWED
    result, x = evaluate_begin(own, phase, t, tangents.lam)
    if result != OK:
        return result
    scales = scales_of(system, work, phase, False)
    copy(tangents.first_q, tangents.q)
    copy(tangents.first_qd, tangents.qd)
    for k in range(tangents.groups):
        drive_tangents(tangents, t, k)
    differentiate(tangents, own, tangents.behind, t, FINISH)
    _store_rates(tangents, tangents.qd, ZERO)
    zero(tangents.kept)
    gamma = 0.0
    for s in range(ONE, stages):
        gamma = h * method.a[s * stages + s]
        ts = stage_time(t, end, h, method.c[s])
        near, lam = x < np.inf, tangents.lam
        result, x = evaluate_again(own, phase, run.k, (ts, h), s, scales, near, lam)
        if result != OK:
            return result
        _add_up(tangents, s, h)
        begin_stage(tangents, own, tangents.behind)
        kept = _kept(tangents) if s > ONE else 0.0
        for k in range(tangents.groups):
            if not _solve(tangents, k, ts, gamma, kept, LEAVE if x == np.inf else FINISH):
                return UNFOLLOWED
            _move(tangents, k, ts, gamma, group_of(tangents, tangents.qdd, k))
        _store_rates(tangents, tangents.qd, s)
    for k in range(tangents.groups):
        _move(tangents, k, end, gamma, group_of(tangents, tangents.qdd, k))
    copy(run.q, work.q)
    copy(run.qd, work.qd)
    if not linearise(unit, system, work, work.q):
        return UNFOLLOWED
    project_tangents(tangents, own, tangents.behind, FINISH)
    return accept_tangents(tangents, own, phase)


@inner
def _store_rates(tangents: Tangents, v: Lanes, s: np.uint64) -> None:
    """v (groups, all blocks D) and δq̈ as the rates of stage s."""
    n, whole = tangents.problem.work.p.size, tangents.Q.size
    for k in range(tangents.groups):
        at = TWO * (k * tangents.problem.method.b.size + s) * n
        for a in each(0, n):
            tangents.rates[at + a] = v[k * whole + a]
            tangents.rates[at + n + a] = tangents.qdd[k * whole + a]


@inner
def _add_up(tangents: Tangents, s: np.uint64, h: float) -> None:
    """δq_b and δv_b of stage s, and a first guess of δk."""
    method, n = tangents.problem.method, tangents.problem.work.p.size
    whole, stages = tangents.Q.size, method.b.size
    for k in range(tangents.groups):
        for a in each(0, n):
            q, v = tangents.first_q[k * whole + a], tangents.first_qd[k * whole + a]
            guess = 0.0 * q
            for m in range(s):
                at = TWO * (k * stages + m) * n + a
                q += (h * method.a[s * stages + m]) * tangents.rates[at]
                v += (h * method.a[s * stages + m]) * tangents.rates[at + n]
                guess += method.guess[s * stages + m] * tangents.rates[at + n]
            at = k * whole + a
            tangents.begun_q[at], tangents.begun_qd[at], tangents.qdd[at] = q, v, guess
        for a in each(n, whole):  # fixed blocks
            at = k * whole + a
            tangents.begun_q[at], tangents.begun_qd[at] = tangents.first_q[at], 0.0 * q


@inner
def _move(tangents: Tangents, k: np.uint64, t: float, gamma: float, dk: Lanes) -> None:
    """δq and δq̇ of group k for a δk (all blocks D,), and of drives at t (s)."""
    n, whole, first = tangents.problem.work.p.size, tangents.Q.size, k * tangents.Q.size
    for a in each(0, n):
        v = tangents.begun_qd[first + a] + gamma * dk[a]
        tangents.q[first + a] = tangents.begun_q[first + a] + gamma * v
        tangents.qd[first + a] = v
    for a in each(first + n, first + whole):
        tangents.q[a], tangents.qd[a] = tangents.begun_q[a], tangents.begun_qd[a]
    drive_tangents(tangents, t, k)


@inner
def _pass(
    tangents: Tangents,
    k: np.uint64,
    t: float,
    gamma: float,
    dk: Lanes,
    slow_modes: np.uint64,
) -> None:
    """δk' of group k from a δk (all blocks D,), at the stage in the workspace of the tangents.

    `slow_modes` as for `solved_together`: a pass that meets one against it is taken again.
    """
    problem, at = tangents.problem, tangents.behind
    good = False
    while not good:
        _move(tangents, k, t, gamma, dk)
        good = project_position(tangents, problem, at, k, slow_modes)
        good = project_velocity(tangents, problem, at, k, slow_modes) and good
        change_forces(tangents, at, k, t)
        add_soft_times(problem.unit, problem.system.soft, 1.0, dk, tangents.f)
        good = accelerate_tangents(tangents, problem, at, k, slow_modes) and good
        good = good or slow_modes == FINISH
        slow_modes = FINISH


@inner
def _kept(tangents: Tangents) -> float:
    """The largest part of a residual that a pass of this step left; 0 if none was seen."""
    kept = 0.0
    for m in range(lanes_of(tangents.kept)):
        kept = max(kept, lane(tangents.kept, ZERO, m))
    return kept


@inner
def _solve(
    tangents: Tangents, k: np.uint64, t: float, gamma: float, kept: float, slow_modes: np.uint64
) -> bool:
    """δk of group k in the stage in the workspace of the tangents, from a guess; whether it is
    found.

    The passes are linear in δk. Where M̂ lacks much of what δQ and the rows have, as under a large
    tension, they would diverge: so each one is a product in a Krylov method, with generalised
    conjugate residuals. Rounding leaves a part ε of each residual in the search: from a guess that
    was close, its result needs no pass of its own. `kept`: of the earlier stages, as of `_kept`,
    or 0. If that part of a residual is rounding, a pass would be the last one, and is not made.
    """
    n, first = tangents.problem.work.p.size, k * tangents.Q.size
    found, x = group_of(tangents, tangents.qdd, k), group_of(tangents, tangents.whole_qdd, k)
    trial, r = group_of(tangents, tangents.whole_q, k), group_of(tangents, tangents.whole_qd, k)
    copy(found, x)
    none, mean = 0.0 * found[0], tangents.problem.system.mean
    before = none + np.inf
    for count in range(RESTARTS):
        _pass(tangents, k, t, gamma, x, slow_modes)
        left, largest, moved = none, none, none
        for a in each(0, n):
            r[a] = found[a] - x[a]
            left, largest = max(left, abs(r[a])), max(largest, abs(found[a]))
            v = abs(tangents.qd[first + a]) + abs(tangents.q[first + a]) / gamma
            moved = max(moved, max(v / gamma, abs(tangents.f[a]) / mean))
        enough = _CONVERGED * largest + _TINY * moved
        rounded = (left > 0.1 * before) & (left <= _ROUNDING * largest + _NOISE * moved)
        if count > 0:
            rounded = rounded | (left <= _ROUNDED * enough)
        if everywhere((left <= enough) | rounded):
            return True
        before, last = left, left
        close, ended = count == 0 and everywhere(left <= _CLOSE * largest), False
        sought = enough if close else enough + _PART * left
        least = _ROUNDED * enough
        for j in range(MOST):
            if close and kept > 0.0:
                ended = everywhere(kept * left <= _UNSEEN * enough)
            if ended:
                break
            for a in each(0, n):
                trial[a] = x[a] + r[a]
            _pass(tangents, k, t, gamma, trial, slow_modes)
            passed = none
            for a in each(0, n):
                passed = max(passed, abs(found[a] - trial[a]))
                trial[a] += r[a] - found[a]  # what r is mapped to
            seen = left > _ABOVE * least
            part = pick(seen, passed / pick(seen, left, 1.0), 0.0)
            tangents.kept[ZERO] = max(tangents.kept[ZERO], part)
            last = left
            left = step_along(tangents.search, n, j, x, r, trial)
            ended = everywhere((left <= sought) | ((left <= least) & (left > 0.1 * last)))
            if ended:
                break
        if ended and close:
            for a in each(0, n):
                found[a] = x[a] + r[a]
            return True
    return False

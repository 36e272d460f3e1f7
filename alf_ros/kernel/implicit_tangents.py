"""The derivatives of q and q̇ by parameters, carried through a step of an implicit method.

A stage solves M k + Φ_qᵀ λ = Q(q, v) at q = q_b + hγ v, v = v_b + hγ k (`implicit`). So δk solves

    M δk + Φ_qᵀ δλ = δQ - δM k - (δΦ_q)ᵀ λ    at δv = δv_b + hγ δk, δq = δq_b + hγ δv

with the constraints of `tangent_solves`. M̂ has most of what δQ gets by way of δk, so passes
M̂ δk' + … = … + (M̂ - M) δk are mostly close to δk soon.

The step is taken again behind the run, where it left off: its k are known, so that each stage is
one evaluation. The run itself has the bits that it has without tangents.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Phase, Problem, Tangents
from alf_ros.kernel.data.tangents import DIRECTIONS
from alf_ros.kernel.driven_tangents import drive_tangents
from alf_ros.kernel.effect_jacobians import add_soft_times, weigh
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, ZERO, expanded, inner
from alf_ros.kernel.numba_ext.lane_numbers import everywhere, pick
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import STOPPED, UNFOLLOWED
from alf_ros.kernel.step import evaluate_first, scales_of, store_angles
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.tangent_axes import accept_tangents
from alf_ros.kernel.tangent_lane_solve import FINISH
from alf_ros.kernel.tangent_solves import (
    accelerate_tangents,
    begin_stage,
    change_forces,
    group_of,
    project_position,
    project_velocity,
)
from alf_ros.kernel.tangent_stage import differentiate, project_tangents, store_multipliers

_NEAREST = 0.01  # distance x to a singular position: rounding e is e / x³ in a derivative
_RESTARTS = 8  # at most
_DIRECTIONS = np.uint64(DIRECTIONS)
_PART = 1e-12  # of the residual that is left before it is computed anew
# residual of δk that is left, of δk, and of δq̇ / hγ, δq / (hγ)² and what forces do to the masses
_CONVERGED, _TINY = 1e-14, 1e-17
_ROUNDING, _NOISE = 1e-9, 1e-11  # what may be rounding, where it becomes no less


@expanded
def carry_implicitly(
    tangents: Tangents, problem: Problem, phase: Phase, t: float, end: float, h: float
) -> int:
    """The tangents of `phase`, where a step of h (s) of `problem` began at t, to its `end`.

    The step ended in the workspace of `problem`. Returns the result; if it is not OK the tangents
    are as before. Beside a singular position they are not followed.
    """
    run, own = problem.work, tangents.problem
    unit, system, method, work = own.unit, own.system, own.method, own.work
    stages = method.b.size
    if run.aside[0] != 0 or run.aside[1] != 0:
        return UNFOLLOWED
    zero(system.soft.weight)
    store_angles(unit, system, work, phase)
    copy(phase.q, work.q)
    if not linearise(unit, system, work, work.q):
        return UNFOLLOWED
    most, felt = evaluate_first(own, phase, t, tangents.lam)
    x = felt / system.ordinary
    if most < 0 or x < _NEAREST:
        return UNFOLLOWED
    scales = scales_of(system, work, phase)
    copy(tangents.first_q, tangents.q)
    copy(tangents.first_qd, tangents.qd)
    for k in range(tangents.groups):
        drive_tangents(tangents, t, k)
    differentiate(tangents, own, tangents.behind, t, FINISH)
    _store_rates(tangents, tangents.qd, ZERO)
    gamma = 0.0
    for s in range(ONE, stages):
        gamma = h * method.a[s * stages + s]
        ts = t + method.c[s] * h
        if problem.forces.kinks.instants.size > 0:
            ts = min(ts, problem.forces.kinks.span[1])
        _begin_stage(own, phase, run.k, ts, s, h)
        count, x, clear = stage(own, ts, scales, x < np.inf, True)
        if told_to_stop(work):
            return STOPPED
        if count <= 0 or not clear or x < _NEAREST:
            return UNFOLLOWED
        store_multipliers(tangents.lam, work.y)
        _add_up(tangents, s, h)
        begin_stage(tangents, own, tangents.behind)
        for k in range(tangents.groups):
            if not _solve(tangents, k, ts, gamma):
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
    return accept_tangents(tangents, phase)


@inner
def _begin_stage(
    problem: Problem, phase: Phase, k: Floats, t: float, s: np.uint64, h: float
) -> None:
    """q and p' of stage s, M̂ there, and its k, as the step left them in k (stages, 3, n)."""
    unit, system, method, work = problem.unit, problem.system, problem.method, problem.work
    n, stages = work.p.size, method.b.size
    for i in range(n):
        q, v = 0.0, 0.0
        for m in range(s):
            weight = method.a[s * stages + m]
            q += weight * k[THREE * m * n + i]
            v += weight * k[THREE * m * n + n + i]
        gamma = h * method.a[s * stages + s]
        system.soft.k[i] = k[THREE * s * n + n + i]
        work.qd[i] = phase.qd[i] + h * v + gamma * system.soft.k[i]
        work.q[i] = phase.q[i] + h * q + gamma * work.qd[i]
    prescribe(system, t, work.q, work.qd, work.qdd)
    weigh(unit, system, problem.forces, work, t, h * method.a[s * stages + s])
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.qd, work.p)
    add_soft_times(unit, system.soft, 1.0, work.qd, work.p)  # (30) with M̂
    copy(work.q, work.base)
    copy(work.q, work.target)


@inner
def _store_rates(tangents: Tangents, v: Lanes, s: np.uint64) -> None:
    """v (groups, all blocks D) and δq̈ as the rates of stage s."""
    n, whole = tangents.problem.work.p.size, tangents.Q.size
    for k in range(tangents.groups):
        at = TWO * (k * tangents.part.size + s) * n
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
def _pass(tangents: Tangents, k: np.uint64, t: float, gamma: float, dk: Lanes) -> None:
    """δk' of group k from a δk (all blocks D,), at the stage in the workspace of the tangents."""
    problem, at = tangents.problem, tangents.behind
    _move(tangents, k, t, gamma, dk)
    project_position(tangents, problem, at, k, FINISH)
    project_velocity(tangents, problem, at, k, FINISH)
    change_forces(tangents, problem, at, k, t)
    add_soft_times(problem.unit, problem.system.soft, 1.0, dk, tangents.f)
    accelerate_tangents(tangents, problem, at, k, FINISH)


@inner
def _solve(tangents: Tangents, k: np.uint64, t: float, gamma: float) -> bool:
    """δk of group k in the stage in the workspace of the tangents, from a guess; whether it is
    found.

    The passes are linear in δk. Where M̂ lacks much of what δQ and the rows have, as under a large
    tension, they would diverge: so each one is a product in a Krylov method, with generalised
    conjugate residuals.
    """
    n, first = tangents.problem.work.p.size, k * tangents.Q.size
    found, x = group_of(tangents, tangents.qdd, k), group_of(tangents, tangents.whole_qdd, k)
    trial, r = group_of(tangents, tangents.whole_q, k), group_of(tangents, tangents.whole_qd, k)
    copy(found, x)
    none, mean = 0.0 * found[0], tangents.problem.system.mean
    before = none + np.inf
    for _ in range(_RESTARTS):
        _pass(tangents, k, t, gamma, x)
        left, largest, moved = none, none, none
        for a in each(0, n):
            r[a] = found[a] - x[a]
            left, largest = max(left, abs(r[a])), max(largest, abs(found[a]))
            v = abs(tangents.qd[first + a]) + abs(tangents.q[first + a]) / gamma
            moved = max(moved, max(v / gamma, abs(tangents.f[a]) / mean))
        enough = _CONVERGED * largest + _TINY * moved
        rounded = (left > 0.1 * before) & (left <= _ROUNDING * largest + _NOISE * moved)
        if everywhere((left <= enough) | rounded):
            return True
        before = left
        enough = enough + _PART * left
        for j in range(_DIRECTIONS):
            for a in each(0, n):
                trial[a] = x[a] + r[a]
            _pass(tangents, k, t, gamma, trial)
            for a in each(0, n):
                trial[a] += r[a] - found[a]  # what r is mapped to
            left = _step_along(tangents, j, x, r, trial)
            if everywhere(left <= enough):
                break
    return False


@inner
def _step_along(tangents: Tangents, j: np.uint64, x: Lanes, r: Lanes, image: Lanes) -> Lanes:
    """x and its residual r (all blocks D,) moved along r, which is mapped to `image`: made
    direction j. Returns the largest of r."""
    n, whole, search = tangents.problem.work.p.size, tangents.Q.size, tangents.search
    p, u = section(search, j * whole, whole), section(search, (_DIRECTIONS + j) * whole, whole)
    for a in each(0, n):
        p[a], u[a] = r[a], image[a]
    for i in range(j):
        along = section(search, i * whole, whole)
        to = section(search, (_DIRECTIONS + i) * whole, whole)
        part = 0.0 * r[0]
        for a in each(0, n):
            part += to[a] * u[a]
        for a in each(0, n):
            p[a] -= part * along[a]
            u[a] -= part * to[a]
    square = 0.0 * r[0]
    for a in each(0, n):
        square += u[a] * u[a]
    scale = 1.0 / np.sqrt(pick(square > 0.0, square, 1.0))
    part = 0.0 * r[0]
    for a in each(0, n):
        p[a], u[a] = scale * p[a], scale * u[a]
        part += u[a] * r[a]
    left = 0.0 * r[0]
    for a in each(0, n):
        x[a] += part * p[a]
        r[a] -= part * u[a]
        left = max(left, abs(r[a]))
    return left

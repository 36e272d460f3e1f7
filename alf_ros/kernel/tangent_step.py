"""The derivatives of q and q̇ by parameters, carried through an accepted step.

The variational equation of the motion is integrated by the method of the step, at its stages:
the step is taken again, from the state where it began. In each stage δq̈ follows from δq and δq̇
by a solve with the factor of that stage (`tangent_stage`, `tangent_solves`). Lengths of steps are
not differentiated: they are numbers of the method.

    for each stage:  q, q̇, q̈, λ and the factor of the stage, as in `step`
        for each parameter:
            δq, δq̇ = those of the begin + h Σ_m a_sm (rates)_m    # unfold_tangents
            beside a singular position: both onto their constraints, along M
            δq̈                                                    # differentiate
            rates of δq, δq̇                                       # fold_tangents
    at the end, δq and δq̇ onto their constraints, along M

Like a step, it adds up in coordinates in which the motion is smooth: a point of a turning bar
moves on a circle, and so does the arrow of its derivative. So δq and δq̇ of a block with an arc
are taken relative to the block that it turns about, along the axes T, N, b of the arc, which turn
by κ ȧ (`arc_coordinates`).

If a stage of a step is beside a singular position, all its stages are projected, and those beside
the position interpolated (`tangent_stage`).
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.arc_coordinates import (
    begin_momenta,
    choose_arcs,
    components,
    composed,
    fold,
    relative,
    shift_along_path,
    unfold,
)
from alf_ros.kernel.augmented_solve import accelerate
from alf_ros.kernel.data import ORIGIN, Phase, Problem, Tangents, Tape
from alf_ros.kernel.interpolated_stages import evaluate_interpolated
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.block import block, put
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, furthest
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import OK, STOPPED, UNFOLLOWED
from alf_ros.kernel.step import add_up, evaluate_first, lag_of_stage, scales_of, store_angles
from alf_ros.kernel.step_tape import PROJECTED, REGULAR, store_axes, store_stage
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.tangent_stage import (
    differentiate,
    differentiate_beside,
    project_tangents,
    take,
)


@inner
def carry_tangents(
    tangents: Tangents,
    phase: Phase,
    ended: tuple[Floats, Floats, float],
    t: float,
    end: float,
    h: float,
    sigma: float,
    tape: Tape | None = None,
) -> int:
    """The tangents of `phase`, where a step of h (s) began at t, to its `end`.

    `ended`: q and q̇ there, and x of the nearest stage; `sigma` as of `step`; `tape`: its stages
    are written there. Returns the result; if it is not OK the tangents are as before.
    """
    ended_q, ended_qd, nearest = ended
    near = nearest < np.inf
    problem = tangents.problem
    unit, system, method, work = problem.unit, problem.system, problem.method, problem.work
    store_angles(unit, system, work, phase)
    copy(phase.q, work.q)
    if not linearise(unit, system, work, work.q):
        return UNFOLLOWED
    most, felt = evaluate_first(problem, phase, t)
    if most < 0:
        return UNFOLLOWED
    x = min(sigma, felt) / system.ordinary
    scales = scales_of(system, work, phase)
    begin_momenta(unit, system, work, phase, choose_arcs(unit, system, work, phase, h))
    _begin(tangents, phase)
    stages = method.b.size
    for s in range(stages):
        add_up(method, work, s, h)
        ts = min(t + method.c[s] * h, end)
        prescribe(system, ts, work.q, work.qd, work.qdd)
        unfold(unit, system, work, phase)
        copy(work.q, work.base)
        if s == 0:
            count, _ = accelerate(problem, ts, True)  # (26)
            clear = x > scales.close
        else:
            copy(work.q, work.target)
            shift_along_path(unit, system.arms, work, h * h * lag_of_stage(method, s))
            count, x, clear = stage(problem, ts, scales, x < np.inf, True)
        if not clear and count > 0:
            moved = furthest(work.q, work.base, work.p.size)
            _unfold_again(problem, phase, ts, s, h)
            count = evaluate_interpolated(problem, phase, ts, s, moved, scales)
        if count > 0:
            fold(unit, system, work, work.qd, work.qdd, s)
            _unfold_tangents(tangents, s, h)
            kind = PROJECTED if near else REGULAR
            if tape is not None:
                store_axes(tape, work, s)
            if x == np.inf:
                count = differentiate(tangents, ts, near)
            else:
                copy(work.q, work.sum_q)
                copy(work.qd, work.sum_qd)
                _unfold_again(problem, phase, ts, s, h)
                count, kind = differentiate_beside(tangents, phase, ts, scales, clear)
            if tape is not None:
                store_stage(tape, tangents, s, kind)
        if told_to_stop(work):
            return STOPPED
        if count <= 0:
            return UNFOLLOWED
        _fold_tangents(tangents, s)
    add_up(method, work, stages, h)
    prescribe(system, end, work.q, work.qd, work.qdd)
    unfold(unit, system, work, phase)
    _unfold_tangents(tangents, stages, h)
    if tape is not None:
        store_axes(tape, work, stages)
        tape.projected[0] = 1 if not near or x == np.inf else 0
    copy(ended_q, work.q)
    copy(ended_qd, work.qd)
    if not near or x == np.inf:  # the end is clear of singular positions
        if not linearise(unit, system, work, work.q):
            return UNFOLLOWED
        if project_tangents(tangents) <= 0:
            return UNFOLLOWED
    return _store(tangents, phase)


@inner
def _unfold_again(problem: Problem, phase: Phase, t: float, s: np.uint64, h: float) -> None:
    """q and p of stage s as the step adds them up, and the direction of the branch there."""
    work = problem.work
    add_up(problem.method, work, s, h)
    prescribe(problem.system, t, work.q, work.qd, work.qdd)
    unfold(problem.unit, problem.system, work, phase)
    copy(work.q, work.base)
    copy(work.qd, work.along)


@inner
def _begin(tangents: Tangents, phase: Phase) -> None:
    """The tangents of the phase along the axes of the arcs where the step begins."""
    work, start = tangents.problem.work, tangents.start
    n, whole = work.p.size, work.q.size
    for k in range(tangents.count):
        for half in range(TWO):
            at = (TWO * k + half) * whole
            for a in range(whole):
                tangents.dq[a] = phase.tangents[at + a]
                if half == 0:
                    tangents.q[k * whole + a] = phase.tangents[at + a]
            _to_axes(tangents, tangents.dq)
            for a in range(n):
                start[(TWO * k + half) * n + a] = tangents.x[a]


@inner
def _to_axes(tangents: Tangents, u: Floats) -> None:
    """u (all blocks D,) along the axes of the arcs, relative to what blocks turn about, to `x`."""
    problem = tangents.problem
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    for i in each(0, arms.about.size):
        if chart.curvature[i] == 0.0:
            put(tangents.x, i, block(unit, u, i))
        else:
            put(tangents.x, i, components(unit, chart, i, relative(unit, arms, i, u)))


@inner
def _from_axes(tangents: Tangents, u: Floats) -> None:
    """The inverse of `_to_axes`, in place."""
    problem = tangents.problem
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    for m in each(0, arms.order.size):
        i = arms.order[m]
        if chart.curvature[i] != 0.0:
            v = composed(unit, chart, i, block(unit, u, i))
            about = arms.about[i]
            if about != ORIGIN:
                v = v + block(unit, u, np.uint64(about))
            put(u, i, v)


@inner
def _unfold_tangents(tangents: Tangents, s: np.uint64, h: float) -> None:
    """δq and δq̇ of stage s, from the rates of the stages before; with s past the last stage, of
    the end of the step."""
    problem, start, rates = tangents.problem, tangents.start, tangents.rates
    method, work = problem.method, problem.work
    n, whole, stages = work.p.size, work.q.size, method.b.size
    for k in range(tangents.count):
        for a in range(n):
            tangents.dq[a] = start[TWO * k * n + a]
            tangents.dqd[a] = start[(TWO * k + ONE) * n + a]
        for a in range(n, whole):  # fixed blocks
            tangents.dq[a], tangents.dqd[a] = tangents.q[k * whole + a], 0.0
        for m in range(s):
            weight = h * (method.a[s * stages + m] if s < stages else method.b[m])
            if weight != 0.0:
                at = TWO * (k * stages + m) * n
                for a in range(n):
                    tangents.dq[a] += weight * rates[at + a]
                    tangents.dqd[a] += weight * rates[at + n + a]
        _from_axes(tangents, tangents.dq)
        _from_axes(tangents, tangents.dqd)
        for a in range(whole):
            tangents.q[k * whole + a] = tangents.dq[a]
            tangents.qd[k * whole + a] = tangents.dqd[a]


@inner
def _fold_tangents(tangents: Tangents, s: np.uint64) -> None:
    """The rates of δq and δq̇ of stage s along the axes of the arcs, which turn."""
    problem, rates = tangents.problem, tangents.rates
    work = problem.work
    unit, arms, chart = problem.unit, problem.system.arms, work.chart
    n, whole, stages = work.p.size, tangents.dq.size, problem.method.b.size
    D = np.uint64(len(unit))
    for k in range(tangents.count):
        at = TWO * (k * stages + s) * n
        take(tangents, k, tangents.q, tangents.qd)
        _to_axes(tangents, tangents.dq)
        copy(tangents.x, tangents.f)
        _to_axes(tangents, tangents.dqd)
        copy(tangents.x, tangents.dq)
        for a in range(n):
            rates[at + a] = tangents.dq[a]
        for a in range(whole):
            tangents.dqd[a] = tangents.qdd[k * whole + a]
        _to_axes(tangents, tangents.dqd)
        for a in range(n):
            rates[at + n + a] = tangents.x[a]
        for i in each(0, arms.about.size):
            if chart.curvature[i] == 0.0:
                continue
            turn, a = chart.curvature[i] * work.k[s * THREE * n + i * D], i * D
            rates[at + a] += turn * tangents.f[a + ONE]
            rates[at + a + ONE] -= turn * tangents.f[a]
            rates[at + n + a] += turn * tangents.dq[a + ONE]
            rates[at + n + a + ONE] -= turn * tangents.dq[a]


@inner
def _store(tangents: Tangents, phase: Phase) -> int:
    """δq and δq̇ into the phase, if they are numbers."""
    whole, check = tangents.dq.size, 0.0
    for a in range(tangents.count * whole):
        check += tangents.q[a] + tangents.qd[a]
    if not np.isfinite(check):
        return UNFOLLOWED
    for k in range(tangents.count):
        for a in range(whole):
            phase.tangents[TWO * k * whole + a] = tangents.q[k * whole + a]
            phase.tangents[(TWO * k + ONE) * whole + a] = tangents.qd[k * whole + a]
    return OK

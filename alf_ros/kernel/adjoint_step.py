"""The adjoint of a run, step by step from its end: the steps of tangents (`tangent_step`),
transposed.

The stages of a step stand on a tape: as they were written down, or if one of them is beside a
singular position the step is taken again. Then the tape is read backwards:
∂J/∂(δq, δq̇) where the step ended becomes that where it began, and what J changes by with each
array of the problem is added up. So the derivatives equal the tangents, to rounding, for
any number of parameters at the cost of one.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.adjoint_arcs import begin_arcs_back, fold_arcs_back, unfold_arcs_back
from alf_ros.kernel.adjoint_stage import take_projections_back, take_stage_back
from alf_ros.kernel.adjoint_sums import take_fixed_back, take_sum_back
from alf_ros.kernel.arc_coordinates import components, composed
from alf_ros.kernel.data import ORIGIN, Adjoint
from alf_ros.kernel.driven_tangents import take_drives_back
from alf_ros.kernel.kinks_over_time import stage_time
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.block import add, block, put, subtract
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, compiled, inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.status import NO_ROOM, OK, STOPPED, UNFOLLOWED
from alf_ros.kernel.step import store_angles
from alf_ros.kernel.step_tape import (
    BEGIN,
    END,
    LENGTH,
    SIGMA,
    SPAN,
    restore_arcs,
    restore_axes,
    restore_recorded,
    restore_stages,
    restore_step,
)
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.tangent_arcs import adds_arcs
from alf_ros.kernel.tangent_step import carry_again


@compiled
def take_steps_back(adjoint: Adjoint, last: int, first: int) -> int:
    """∂J/∂(q, q̇) behind step `last` of the record, in `bar_q` and `bar_qd`, into that before step
    `first`; returns the result."""
    for back in range(last + 1 - first):
        adjoint.at[0] = last - back
        result = _take_step_back(adjoint, np.uint64(last - back), back > 0)
        if result != OK:
            return result
    return OK


@inner
def _take_step_back(adjoint: Adjoint, k: np.uint64, linear: bool) -> int:
    """Step k; `linear`: Φ_q and factor stand in `work`, at the q there."""
    tangents, record, phase, tape = adjoint.tangents, adjoint.record, adjoint.phase, adjoint.tape
    problem = tangents.problem
    method, work = problem.method, problem.work
    span, whole, n, stages = record.span, work.q.size, work.p.size, method.b.size
    at = k * np.uint64(SPAN)
    t, end, h = (
        span[at + np.uint64(BEGIN)],
        span[at + np.uint64(END)],
        span[at + np.uint64(LENGTH)],
    )
    sigma = span[at + np.uint64(SIGMA)]
    restore_step(record, k, phase)
    copy(section(record.ended_q, k * whole, whole), adjoint.x)
    copy(section(record.ended_qd, k * whole, whole), adjoint.u)
    if record.regular[k] != 0:
        tangents.along[0] = 1 if restore_stages(record, tape, work, k) else 0
        store_angles(problem.unit, problem.system, work, phase)
        for a in range(whole):  # mostly the first stage of the step behind it
            linear = linear and work.q[a] == adjoint.x[a]
        copy(adjoint.x, work.q)
        copy(adjoint.u, work.qd)
        if not linear and not linearise(problem.unit, problem.system, work, work.q):
            return UNFOLLOWED
    else:
        ended = adjoint.x, adjoint.u, adjoint.ended
        result = carry_again(tangents, phase, ended, True, (t, end, h), sigma, tape)
        if result != OK:
            return result
    arcs = adds_arcs(tangents)
    if arcs:
        restore_arcs(tape, work, stages)
        zero(adjoint.first_q)
        zero(adjoint.first_qd)
        zero(adjoint.xi)
        zero(adjoint.axes)
        zero(adjoint.bend)
    copy(adjoint.bar_q, adjoint.q)
    copy(adjoint.bar_qd, adjoint.qd)
    if tape.projected[0] != 0:  # q, q̇, Φ_q and factor of the end stand in `work`
        if take_projections_back(adjoint) <= 0:
            return UNFOLLOWED
    zero(adjoint.start)
    zero(adjoint.rates)
    for a in range(n, whole):
        adjoint.bar_q[a] = 0.0
    zero(adjoint.qdd)
    _add_up_back(adjoint, end, stages, h)
    for back in range(stages):
        s = stages - ONE - back
        ts = stage_time(t, end, h, method.c[s])
        _fold_back(adjoint, k, s)
        count = take_stage_back(adjoint, ts, k, s)
        if count <= 0:
            return NO_ROOM if count < 0 else UNFOLLOWED
        _add_up_back(adjoint, ts, s, h)
        if told_to_stop(work):
            return STOPPED
    zero(adjoint.qdd)
    if arcs:
        begin_arcs_back(adjoint)
    else:
        _begin_back(adjoint)
    take_drives_back(adjoint, t)
    for a in range(whole):
        adjoint.bar_q[a] = adjoint.q[a] if a < n else adjoint.bar_q[a] + adjoint.q[a]
        adjoint.bar_qd[a] = adjoint.qd[a] if a < n else 0.0
    return OK


@inner
def _begin_back(adjoint: Adjoint) -> None:
    """∂J/∂ the sums where the step begins, into ∂J/∂(δq, δq̇), in `q` and `qd`."""
    work = adjoint.tangents.problem.work
    n = work.p.size
    for i in range(work.chart.sin.size):
        work.chart.sin[i], work.chart.cos[i] = 0.0, 1.0
    zero(adjoint.q)
    zero(adjoint.qd)
    for a in range(n):
        adjoint.x[a] = adjoint.start[a]
    _to_axes_back(adjoint, adjoint.q)
    for a in range(n):
        adjoint.x[a] = adjoint.start[n + a]
    _to_axes_back(adjoint, adjoint.qd)


@inner
def _add_up_back(adjoint: Adjoint, t: float, s: np.uint64, h: float) -> None:
    """∂J/∂(δq, δq̇) of stage s at t (s) as the step adds them up, or of its end, into the ones of
    its begin and of the rates of the stages before."""
    problem = adjoint.tangents.problem
    n, by_q, by_qd = problem.work.p.size, adjoint.q, adjoint.qd
    restore_axes(adjoint.tape, problem.work, s)
    if adds_arcs(adjoint.tangents):
        restore_arcs(adjoint.tape, problem.work, s)
        if s > 0:
            unfold_arcs_back(adjoint)
        else:
            for a in range(n):
                adjoint.first_q[a] += adjoint.q[a]
                adjoint.first_qd[a] += adjoint.qd[a]
        by_q, by_qd = section(adjoint.xi, 0, n), section(adjoint.xi, n, n)
    else:
        _from_axes_back(adjoint, adjoint.q)
        _from_axes_back(adjoint, adjoint.qd)
    take_drives_back(adjoint, t)
    take_fixed_back(adjoint)
    take_sum_back(adjoint, by_q, by_qd, s, h)


@inner
def _fold_back(adjoint: Adjoint, k: np.uint64, s: np.uint64) -> None:
    """∂J/∂ the rates of stage s of step k into ∂J/∂(δq, δq̇, δq̈) of the stage, in `q`, `qd` and
    `qdd`."""
    problem, rates = adjoint.tangents.problem, adjoint.rates
    work = problem.work
    n = work.p.size
    at = TWO * s * n
    restore_axes(adjoint.tape, work, s)
    if adds_arcs(adjoint.tangents):
        restore_arcs(adjoint.tape, work, s)
        restore_recorded(adjoint.record, adjoint.tangents, problem.method.b.size, k, s)
        fold_arcs_back(adjoint, s)
        return
    zero(adjoint.q)
    zero(adjoint.qd)
    zero(adjoint.qdd)
    for a in range(n):
        adjoint.x[a] = rates[at + a]
    _to_axes_back(adjoint, adjoint.qd)
    _turn_back(adjoint, s, at)
    _to_axes_back(adjoint, adjoint.q)
    for a in range(n):
        adjoint.x[a] = rates[at + n + a]
    _to_axes_back(adjoint, adjoint.qdd)
    _turn_back(adjoint, s, at + n)
    _to_axes_back(adjoint, adjoint.qd)


@inner
def _turn_back(adjoint: Adjoint, s: np.uint64, at: np.uint64) -> None:
    """Of the turning of the axes: ∂J/∂ the rates from number `at` on, into ∂J/∂ the arrows that
    turn."""
    problem, rates, x = adjoint.tangents.problem, adjoint.rates, adjoint.x
    unit, arms, work = problem.unit, problem.system.arms, problem.work
    n, D = work.p.size, np.uint64(len(unit))
    zero(x)
    for i in each(0, arms.about.size):
        if work.chart.curvature[i] != 0.0:
            turn, a = work.chart.curvature[i] * work.k[s * THREE * n + i * D], i * D
            x[a + ONE] = turn * rates[at + a]
            x[a] = -turn * rates[at + a + ONE]


@inner
def _to_axes_back(adjoint: Adjoint, bar: Floats) -> None:
    """∂J/∂ components along the axes of the arcs, in `x`, added to ∂J/∂ the vectors (all blocks
    D,) that have them."""
    problem = adjoint.tangents.problem
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    for i in each(0, arms.about.size):
        v = block(unit, adjoint.x, i)
        if chart.curvature[i] == 0.0:
            add(bar, i, v)
            continue
        v = composed(unit, chart, i, v)
        add(bar, i, v)
        if arms.about[i] != ORIGIN:
            subtract(bar, np.uint64(arms.about[i]), v)


@inner
def _from_axes_back(adjoint: Adjoint, bar: Floats) -> None:
    """The same of the way back from the axes, in place."""
    problem = adjoint.tangents.problem
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    for back in each(0, arms.order.size):
        i = arms.order[arms.order.size - ONE - back]
        if chart.curvature[i] != 0.0:
            v = block(unit, bar, i)
            if arms.about[i] != ORIGIN:
                add(bar, np.uint64(arms.about[i]), v)
            put(bar, i, components(unit, chart, i, v))

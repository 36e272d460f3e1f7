"""Derivatives of a state in the coordinates of a step.

Planar steps along arcs have the derivative of their own coordinates (`tangent_arcs`). In space,
and beside singular positions, arrows turn with the arcs: a point of a turning bar moves on a
circle, and so does the arrow of its derivative. So δq and δq̇ of a block with an arc are taken
relative to the block that it turns about, along the axes T, N, b of the arc, which turn by κ ȧ
(`arc_coordinates`).
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.arc_coordinates import components, composed, relative
from alf_ros.kernel.data import ORIGIN, Method, Phase, Problem, Tangents
from alf_ros.kernel.driven_tangents import drive_tangents
from alf_ros.kernel.numba_ext.block import block, packed, put
from alf_ros.kernel.numba_ext.jit import THREE, TWO, ZERO, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import everywhere
from alf_ros.kernel.numba_ext.lane_structs import lane, lanes_of, section, set_lane
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import add_times, add_two_times, copy, copy_first, zero
from alf_ros.kernel.status import OK, UNFOLLOWED
from alf_ros.kernel.tangent_arcs import adds_arcs, begin_arcs, fold_arcs, unfold_arcs
from alf_ros.kernel.tangent_solves import group_of


@inner
def read_tangents(tangents: Tangents, phase: Phase) -> None:
    """δq and δq̇ where a step begins, from the phase."""
    whole, W = tangents.Q.size, lanes_of(tangents.q)
    for p in range(tangents.count):
        k, m, at = p // W, p % W, TWO * p * whole
        for a in range(whole):
            set_lane(tangents.first_q, k * whole + a, m, phase.tangents[at + a])
            set_lane(tangents.first_qd, k * whole + a, m, phase.tangents[at + whole + a])


@inner
def accept_tangents(tangents: Tangents, problem: Problem, phase: Phase) -> int:
    """δq and δq̇ of the end of the step into the phase, if they are numbers."""
    whole, W, check = tangents.Q.size, lanes_of(tangents.q), 0.0
    for a in range(tangents.groups * whole):
        check += tangents.q[a] + tangents.qd[a]
    if not everywhere(abs(check) < np.inf):
        return UNFOLLOWED
    copy(tangents.q, tangents.first_q)
    copy(tangents.qd, tangents.first_qd)
    changing = whole if tangents.drive.size > 0 else problem.work.p.size  # fixed blocks stay
    for p in range(tangents.count):
        k, m, at = p // W, p % W, TWO * p * whole
        for a in range(changing):
            phase.tangents[at + a] = lane(tangents.q, k * whole + a, m)
            phase.tangents[at + whole + a] = lane(tangents.qd, k * whole + a, m)
    return OK


@inner
def begin_tangents(tangents: Tangents, problem: Problem, phase: Phase, near: bool) -> None:
    """Begin the sums of a step at `phase`: δq and δq̇, or along arcs δξ and δw.

    `near`: a stage is beside a singular position. Momenta do not determine δq̇ there.
    """
    exactly = len(problem.unit) == 2 and problem.work.chart.arcs[0] > 0 and not near
    tangents.along[0] = 1 if exactly else 0
    if adds_arcs(tangents):
        begin_arcs(tangents, problem, phase)
        return
    n = problem.work.p.size
    for k in range(tangents.groups):
        at = TWO * k * n
        q, qd = group_of(tangents, tangents.first_q, k), group_of(tangents, tangents.first_qd, k)
        _to_axes(problem, q, section(tangents.start, at, n))
        _to_axes(problem, qd, section(tangents.start, at + n, n))


@inner
def _to_axes(problem: Problem, u: Lanes, to: Lanes) -> None:
    """u (all blocks D,) along the axes of the arcs, relative to what blocks turn about."""
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    for i in each(0, arms.about.size):
        if chart.curvature[i] == 0.0:
            put(to, i, block(unit, u, i))
        else:
            put(to, i, components(unit, chart, i, relative(unit, arms, i, u)))


@inner
def _from_axes(problem: Problem, u: Lanes) -> None:
    """The inverse of `_to_axes`, in place."""
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
def take_first_tangents(tangents: Tangents, problem: Problem) -> None:
    """δq and δq̇ of the first stage of a step that adds up arcs."""
    copy(tangents.first_q, tangents.q)
    copy(tangents.first_qd, tangents.qd)
    if adds_arcs(tangents):
        zero(tangents.place)
        copy(tangents.start, tangents.xi)


@inner
def unfold_tangents(
    tangents: Tangents, problem: Problem, t: float, s: np.uint64, h: float
) -> None:
    """δq and δq̇ of stage s at t (s), from the rates of the stages before; with s past the last
    stage, of the end of the step. Along arcs δp stands in the place of δq̇."""
    arcs = adds_arcs(tangents)
    if arcs:
        copy_first(problem.work.total, tangents.place, problem.work.p.size)
    work = problem.work
    n, whole = work.p.size, work.q.size
    for k in range(tangents.groups):
        q, qd = group_of(tangents, tangents.q, k), group_of(tangents, tangents.qd, k)
        sums = section(tangents.xi, TWO * k * n, TWO * n)
        _add_up(tangents, problem.method, k, s, h, sums, TWO * n)
        if not arcs:
            copy_first(sums, q, n)
            copy_first(section(sums, n, n), qd, n)
        for a in each(n, whole):  # fixed blocks
            q[a], qd[a] = tangents.first_q[k * whole + a], 0.0
        drive_tangents(tangents, t, k)
        if arcs:
            unfold_arcs(tangents, problem, k)
        elif work.chart.arcs[0] > 0:
            _from_axes(problem, q)
            _from_axes(problem, qd)


@inlined
def _add_up(
    tangents: Tangents,
    method: Method,
    k: np.uint64,
    s: np.uint64,
    h: float,
    sums: Lanes,
    both: np.uint64,
) -> None:
    """The sums of group k in stage s, `both` numbers, from the rates of the stages before, two at
    a time."""
    stages, rates = method.b.size, tangents.rates
    copy_first(section(tangents.start, k * both, both), sums, both)
    waits, before = 0.0, section(rates, ZERO, both)
    for m in range(s):
        weight = h * (method.a[s * stages + m] if s < stages else method.b[m])
        if weight != 0.0:
            here = section(rates, (k * stages + m) * both, both)
            if waits == 0.0:
                waits, before = weight, here
            else:
                add_two_times(waits, before, weight, here, sums, both)
                waits = 0.0
    if waits != 0.0:
        add_times(waits, before, sums, both)


@inner
def fold_tangents(tangents: Tangents, problem: Problem, s: np.uint64) -> None:
    """The rates of the sums in stage s."""
    if adds_arcs(tangents):
        for k in range(tangents.groups):
            fold_arcs(tangents, problem, k, s)
        return
    unit, arms, work = problem.unit, problem.system.arms, problem.work
    chart, n, stages = work.chart, work.p.size, problem.method.b.size
    D = np.uint64(len(unit))
    for k in range(tangents.groups):
        q, qd = group_of(tangents, tangents.q, k), group_of(tangents, tangents.qd, k)
        qdd, at = group_of(tangents, tangents.qdd, k), TWO * (k * stages + s) * n
        of_q, of_qd = section(tangents.rates, at, n), section(tangents.rates, at + n, n)
        for i in each(0, arms.about.size):
            if chart.curvature[i] == 0.0:
                put(of_q, i, block(unit, qd, i))
                put(of_qd, i, block(unit, qdd, i))
                continue
            u = components(unit, chart, i, relative(unit, arms, i, q))
            v = components(unit, chart, i, relative(unit, arms, i, qd))
            w = components(unit, chart, i, relative(unit, arms, i, qdd))
            turn = chart.curvature[i] * work.k[s * THREE * n + i * D]
            put(of_q, i, v + turn * packed(unit, u[1], -u[0], 0.0))
            put(of_qd, i, w + turn * packed(unit, v[1], -v[0], 0.0))

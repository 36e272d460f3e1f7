"""Steps of tangents along arcs (`tangent_arcs`), transposed.

Each function turns ∂J/∂ the results of one there into ∂J/∂ its arguments. The axes and curvatures
of the arcs are arguments of all stages, so their ∂J/∂ are summed up over the step.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.adjoint_solves import take_mass_back
from alf_ros.kernel.arc_coordinates import composed, is_about_movable
from alf_ros.kernel.data import ORIGIN, Adjoint
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import Block, add, block, dot, packed, put, subtract
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inlined, inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, zero


@inner
def begin_arcs_back(adjoint: Adjoint) -> None:
    """∂J/∂(δt, δn, δκ, δw) where the step begins, into ∂J/∂(δq, δq̇), in `q` and `qd`."""
    problem, phase = adjoint.tangents.problem, adjoint.phase
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    n, blocks, f = problem.work.p.size, arms.about.size, adjoint.f
    start = section(adjoint.start, n, n)
    for i in each(0, blocks):
        chart.sin[i], chart.cos[i] = 0.0, 1.0
        bent, w = chart.curvature[i], block(unit, start, i)
        if bent == 0.0:
            put(f, i, w)
            continue
        t, n_axis = block(unit, chart.t, i), block(unit, chart.n, i)
        P = composed(unit, chart, i, block(unit, chart.momentum, i))
        by_t = block(unit, adjoint.axes, TWO * i) + w[0] * P
        by_n = block(unit, adjoint.axes, TWO * i + ONE) + w[1] * P
        put(f, i, composed(unit, chart, i, w))
        turn = dot(n_axis, by_t) - dot(t, by_n)
        d = (bent * turn) * t + (bent * bent * adjoint.bend[i]) * n_axis
        _add_relative(adjoint, i, d, adjoint.first_q)
    copy(adjoint.first_q, adjoint.q)
    copy(adjoint.first_qd, adjoint.qd)
    _momenta_back(adjoint, adjoint.qd, phase.qd)


@inlined
def _add_relative(adjoint: Adjoint, i: np.uint64, v: Block, bar: Floats) -> None:
    """∂J/∂ a vector of block i relative to the block about which it turns, into `bar` of both."""
    about = adjoint.tangents.problem.system.arms.about[i]
    add(bar, i, v)
    if about != ORIGIN:
        subtract(bar, np.uint64(about), v)


@inner
def _momenta_back(adjoint: Adjoint, bar: Floats, v: Floats) -> None:
    """∂J/∂(M δv + δM v), added up over the blocks whose arcs are about a block, in `f`: into
    ∂J/∂δv, in `bar`, and ∂J/∂δM."""
    problem, f = adjoint.tangents.problem, adjoint.f
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    for m in each(0, arms.order.size):
        i = arms.order[m]
        if is_about_movable(arms, i) and chart.curvature[i] != 0.0:
            add(f, i, block(unit, f, np.uint64(arms.about[i])))
    add_mass_times(unit, problem.system.mass, 1.0, f, bar)
    take_mass_back(adjoint, 1.0, f, v)


@inner
def unfold_arcs_back(adjoint: Adjoint) -> None:
    """∂J/∂(δq, δp) of a stage, in `q` and `qd`, into ∂J/∂(δξ, δw), added to `xi`, and into ∂J/∂
    δq where the step begins and ∂J/∂ the arcs."""
    problem = adjoint.tangents.problem
    unit, arms, work = problem.unit, problem.system.arms, problem.work
    chart, n, q, p = work.chart, work.p.size, adjoint.q, adjoint.qd
    xi, momenta = section(adjoint.xi, 0, n), section(adjoint.xi, n, n)
    for m in each(0, arms.order.size):
        i = arms.order[arms.order.size - ONE - m]
        if is_about_movable(arms, i) and chart.curvature[i] != 0.0:
            subtract(p, i, block(unit, p, np.uint64(arms.about[i])))
    for m in each(0, arms.order.size):
        i = arms.order[arms.order.size - ONE - m]
        bent, d, P = chart.curvature[i], block(unit, q, i), block(unit, p, i)
        add(adjoint.first_q, i, d)
        if bent == 0.0:
            add(xi, i, d)
            add(momenta, i, P)
            continue
        if arms.about[i] != ORIGIN:
            to = np.uint64(arms.about[i])
            add(q, to, d)
            subtract(adjoint.first_q, to, d)
        t, n_axis = block(unit, chart.t, i), block(unit, chart.n, i)
        sin, cos, rho = chart.sin[i], chart.cos[i], chart.rho[i]
        place, w, radius = block(unit, work.total, i), block(unit, chart.w, i), 1.0 / bent
        a, c, versine = place[0], place[1], 1.0 - cos
        T, N = cos * t + sin * n_axis, cos * n_axis - sin * t
        along = rho * (a * cos - sin * radius) * radius - c * sin * radius
        inward = (a * sin - versine * radius) * radius - c * a * sin
        adjoint.bend[i] += along * dot(t, d) + inward * dot(n_axis, d)
        by_t, by_n = (rho * sin * radius) * d, (c * cos + versine * radius) * d
        wt, across = w[0] / rho, dot(T, P) / rho
        add(momenta, i, packed(unit, across, dot(N, P), 0.0))
        add(xi, i, packed(unit, rho * dot(T, d), dot(N, d), 0.0))
        add(adjoint.axes, TWO * i, by_t)
        add(adjoint.axes, TWO * i + ONE, by_n)
        _axes_back(adjoint, i, wt * P, w[1] * P, -wt * across)


@inner
def _axes_back(adjoint: Adjoint, i: np.uint64, by_T: Block, by_N: Block, by_rho: float) -> None:
    """∂J/∂(δT, δN, δρ) of the arc of block i in a stage into ∂J/∂ its δξ and ∂J/∂ the arcs."""
    problem = adjoint.tangents.problem
    unit, work = problem.unit, problem.work
    chart, place, bent = work.chart, block(unit, work.total, i), work.chart.curvature[i]
    t, n_axis, sin, cos = (
        block(unit, chart.t, i),
        block(unit, chart.n, i),
        chart.sin[i],
        chart.cos[i],
    )
    turn = dot(cos * n_axis - sin * t, by_T) - dot(cos * t + sin * n_axis, by_N)
    add(adjoint.axes, TWO * i, cos * by_T - sin * by_N)
    add(adjoint.axes, TWO * i + ONE, sin * by_T + cos * by_N)
    add(adjoint.xi, i, packed(unit, bent * turn, -bent * by_rho, 0.0))
    adjoint.bend[i] += place[0] * turn - place[1] * by_rho


@inner
def fold_arcs_back(adjoint: Adjoint, s: np.uint64) -> None:
    """∂J/∂ the rates of δξ and δw of stage s into ∂J/∂(δq̇, δq̈), in `qd` and `qdd`,
    ∂J/∂(δξ, δw), in `xi`, and ∂J/∂ the arcs."""
    problem, rates = adjoint.tangents.problem, adjoint.rates
    unit, arms, work = problem.unit, problem.system.arms, problem.work
    chart, n, blocks, f = work.chart, work.p.size, arms.about.size, adjoint.f
    at, first = TWO * s * n, s * THREE * blocks
    of_xi, of_w = section(rates, at, n), section(rates, at + n, n)
    momenta = section(adjoint.xi, n, n)
    zero(adjoint.q)
    zero(adjoint.qd)
    zero(adjoint.qdd)
    zero(adjoint.xi)
    for i in each(0, blocks):
        bent, x, y = chart.curvature[i], block(unit, of_xi, i), block(unit, of_w, i)
        if bent == 0.0:
            add(adjoint.qd, i, x)
            put(f, i, y)
            continue
        t, n_axis = block(unit, chart.t, i), block(unit, chart.n, i)
        sin, cos, rho, w = chart.sin[i], chart.cos[i], chart.rho[i], block(unit, chart.w, i)
        rate, wd = block(unit, work.k, first + i), block(unit, work.k, first + TWO * blocks + i)
        ad, cd, wt, wn = rate[0], rate[1], w[0] / rho, w[1]
        turned = rho * ad * wn - cd * wt
        P0, P1 = (wd[0] - bent * turned) / rho, wd[1] + bent * ad * wt
        T, N = cos * t + sin * n_axis, cos * n_axis - sin * t
        by_P0, by_P1 = rho * y[0], y[1]
        by_ad = x[0] + bent * (rho * wn * y[0] - wt * y[1])
        by_cd = x[1] - bent * wt * y[0]
        by_wt, by_wn = -bent * (cd * y[0] + ad * y[1]), bent * rho * ad * y[0]
        by_rho = (P0 + bent * ad * wn) * y[0] - (wt * by_wt + ad * by_ad) / rho
        adjoint.bend[i] += turned * y[0] - ad * wt * y[1]
        add(momenta, i, packed(unit, by_wt / rho, by_wn, 0.0))
        along = by_ad / rho
        v, P = (rho * ad) * T + cd * N, P0 * T + P1 * N
        _add_relative(adjoint, i, along * T + by_cd * N, adjoint.qd)
        put(f, i, by_P0 * T + by_P1 * N)
        _axes_back(adjoint, i, along * v + by_P0 * P, by_cd * v + by_P1 * P, by_rho)
    _momenta_back(adjoint, adjoint.qdd, work.qdd)

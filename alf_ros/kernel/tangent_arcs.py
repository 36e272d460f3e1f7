"""Derivatives of a step of a planar mechanism in the step's own coordinates: arcs ξ and momenta w.

A step that is added up along arcs (`arc_coordinates`) has the derivative of that sum: δξ and δw
are added up as ξ and w are, and what unfolds and folds them is differentiated. Left out is how the
way changes by which a stage is moved onto Φ = 0, as M and Φ_q change (`project_position`). The
coordinates depend on where the step begins. There t and n turn with d, and κ = 1 / |d|:

    δt = n κ t·δd,   δn = -t κ t·δd,   δκ = κ² n·δd

A stage is unfolded into δq and δp. Its δq̇ follows as q̇ does (33), with the σ of the stage:

    M δq̇ + Φ_qᵀ δσ = δp - δM q̇ - (δΦ_q)ᵀ σ,   Φ_q δq̇ = -(δΦ_q) q̇

In space the circle of an arc also depends on accelerations: see `tangent_axes`.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.arc_coordinates import components, composed, is_about_movable, relative
from alf_ros.kernel.data import ORIGIN, Phase, Problem, Tangents
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import add, block, dot, packed, put, subtract
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import zero
from alf_ros.kernel.tangent_solves import add_mass_change, group_of


@inner
def adds_arcs(tangents: Tangents) -> bool:
    """Whether the tangents of the step are added up along its arcs."""
    return tangents.along[0] != 0


@inner
def begin_arcs(tangents: Tangents, problem: Problem, phase: Phase) -> None:
    """δt, δn, δκ and δw where the step begins at `phase`. δξ is 0 there."""
    unit, arms, chart = problem.unit, problem.system.arms, problem.work.chart
    n, blocks, f = problem.work.p.size, arms.about.size, tangents.f
    for k in range(tangents.groups):
        at, of = TWO * k * n, TWO * k * blocks
        dq = group_of(tangents, tangents.first_q, k)
        _momenta(tangents, problem, k, group_of(tangents, tangents.first_qd, k), phase.qd)
        zero(section(tangents.start, at, n))
        start = section(tangents.start, at + n, n)
        for i in each(0, blocks):
            bent, dw = chart.curvature[i], block(unit, f, i)
            if bent == 0.0:
                put(start, i, dw)
                continue
            t, n_axis = block(unit, chart.t, i), block(unit, chart.n, i)
            d = relative(unit, arms, i, dq)
            turn = bent * dot(t, d)
            dt, dn = turn * n_axis, (-turn) * t
            put(tangents.axes, of + TWO * i, dt)
            put(tangents.axes, of + TWO * i + ONE, dn)
            tangents.bend[k * blocks + i] = (bent * bent) * dot(n_axis, d)
            P = composed(unit, chart, i, block(unit, chart.momentum, i))
            dw = components(unit, chart, i, dw)
            put(start, i, dw + packed(unit, dot(P, dt), dot(P, dn), 0.0))


@inner
def _momenta(tangents: Tangents, problem: Problem, k: np.uint64, dv: Lanes, v: Floats) -> None:
    """M δv + δM v into `f`, added up over the blocks whose arcs are about a block."""
    unit, arms, chart, f = problem.unit, problem.system.arms, problem.work.chart, tangents.f
    zero(f)
    add_mass_times(unit, problem.system.mass, 1.0, dv, f)
    if tangents.mass_changes[k] != 0:
        add_mass_change(problem, tangents, k, 1.0, v)
    for m in each(0, arms.order.size):
        i = arms.order[arms.order.size - ONE - m]
        if is_about_movable(arms, i) and chart.curvature[i] != 0.0:
            add(f, np.uint64(arms.about[i]), block(unit, f, i))


@inner
def unfold_arcs(tangents: Tangents, problem: Problem, k: np.uint64) -> None:
    """δq and, in the place of δq̇, δp of group k from δξ and δw, where the step was unfolded
    last. Prescribed blocks have been placed before."""
    unit, arms, work = problem.unit, problem.system.arms, problem.work
    chart, n, blocks = work.chart, work.p.size, arms.about.size
    q, p = group_of(tangents, tangents.q, k), group_of(tangents, tangents.qd, k)
    first, of = group_of(tangents, tangents.first_q, k), TWO * k * blocks
    xi, momenta = section(tangents.xi, TWO * k * n, n), section(tangents.xi, TWO * k * n + n, n)
    for m in each(0, arms.order.size):
        i = arms.order[m]
        bent, dx, dw = chart.curvature[i], block(unit, xi, i), block(unit, momenta, i)
        if bent == 0.0:
            put(q, i, block(unit, first, i) + dx)
            put(p, i, dw)
            continue
        t, n_axis = block(unit, chart.t, i), block(unit, chart.n, i)
        dt, dn = (
            block(unit, tangents.axes, of + TWO * i),
            block(unit, tangents.axes, of + TWO * i + ONE),
        )
        dbent, sin, cos, rho = (
            tangents.bend[k * blocks + i],
            chart.sin[i],
            chart.cos[i],
            chart.rho[i],
        )
        place, w, radius = block(unit, tangents.place, i), block(unit, chart.w, i), 1.0 / bent
        a, c, versine = place[0], place[1], 1.0 - cos
        T, N = cos * t + sin * n_axis, cos * n_axis - sin * t
        turn, drho = bent * dx[0] + a * dbent, -bent * dx[1] - c * dbent
        dT, dN = cos * dt + sin * dn + turn * N, cos * dn - sin * dt - turn * T
        d = (rho * sin * radius) * dt + (c * cos + versine * radius) * dn
        d = d + (rho * dx[0]) * T + dx[1] * N
        along = rho * (a * cos - sin * radius) * radius - c * sin * radius
        inward = (a * sin - versine * radius) * radius - c * a * sin
        d = d + (along * dbent) * t + (inward * dbent) * n_axis
        wt = w[0] / rho
        P = wt * dT + w[1] * dN + ((dw[0] - wt * drho) / rho) * T + dw[1] * N
        d = block(unit, first, i) + d
        if arms.about[i] != ORIGIN:
            to = np.uint64(arms.about[i])
            d = d + (block(unit, q, to) - block(unit, first, to))
        put(q, i, d)
        put(p, i, P)
    for m in each(0, arms.order.size):
        i = arms.order[m]
        if is_about_movable(arms, i) and chart.curvature[i] != 0.0:
            subtract(p, np.uint64(arms.about[i]), block(unit, p, i))


@inner
def fold_arcs(tangents: Tangents, problem: Problem, k: np.uint64, s: np.uint64) -> None:
    """The rates of δξ and δw of stage s of group k, from its δq̇ and δq̈."""
    unit, arms, work = problem.unit, problem.system.arms, problem.work
    chart, n, blocks, f = work.chart, work.p.size, arms.about.size, tangents.f
    qd, qdd = group_of(tangents, tangents.qd, k), group_of(tangents, tangents.qdd, k)
    at, of, first = TWO * (k * problem.method.b.size + s) * n, TWO * k * blocks, s * THREE * blocks
    of_xi, of_w = section(tangents.rates, at, n), section(tangents.rates, at + n, n)
    xi, momenta = section(tangents.xi, TWO * k * n, n), section(tangents.xi, TWO * k * n + n, n)
    _momenta(tangents, problem, k, qdd, chart.first if s == 0 else work.qdd)
    for i in each(0, blocks):
        bent, dP = chart.curvature[i], block(unit, f, i)
        if bent == 0.0:
            put(of_xi, i, block(unit, qd, i))
            put(of_w, i, dP)
            continue
        t, n_axis = block(unit, chart.t, i), block(unit, chart.n, i)
        dt, dn = (
            block(unit, tangents.axes, of + TWO * i),
            block(unit, tangents.axes, of + TWO * i + ONE),
        )
        dbent, sin, cos, rho = (
            tangents.bend[k * blocks + i],
            chart.sin[i],
            chart.cos[i],
            chart.rho[i],
        )
        place, w = block(unit, tangents.place, i), block(unit, chart.w, i)
        rate, wd = block(unit, work.k, first + i), block(unit, work.k, first + TWO * blocks + i)
        ad, cd, wt, wn = rate[0], rate[1], w[0] / rho, w[1]
        turned = rho * ad * wn - cd * wt
        P0, P1 = (wd[0] - bent * turned) / rho, wd[1] + bent * ad * wt
        dx, dw = block(unit, xi, i), block(unit, momenta, i)
        T, N = cos * t + sin * n_axis, cos * n_axis - sin * t
        turn, drho = bent * dx[0] + place[0] * dbent, -bent * dx[1] - place[1] * dbent
        dT, dN = cos * dt + sin * dn + turn * N, cos * dn - sin * dt - turn * T
        v, P, dv = (rho * ad) * T + cd * N, P0 * T + P1 * N, relative(unit, arms, i, qd)
        dad, dcd = (dot(T, dv) + dot(v, dT) - ad * drho) / rho, dot(N, dv) + dot(v, dN)
        dwt, dwn = (dw[0] - wt * drho) / rho, dw[1]
        along = rho * (dot(T, dP) + dot(P, dT)) + P0 * drho + turned * dbent
        along += bent * (ad * wn * drho + rho * wn * dad + rho * ad * dwn - wt * dcd - cd * dwt)
        inward = dot(N, dP) + dot(P, dN) - ad * wt * dbent - bent * (wt * dad + ad * dwt)
        put(of_xi, i, packed(unit, dad, dcd, 0.0))
        put(of_w, i, packed(unit, along, inward, 0.0))

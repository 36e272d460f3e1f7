"""The coordinates in which a step adds up: arcs for blocks that turn about another, and momenta.

A Runge-Kutta method asks of its coordinates that a motion be smooth in them, no more. A point of a
bar that turns goes round in a circle, of which a Cartesian coordinate must follow every harmonic,
while along the arc it hardly accelerates. So, in one step, a block at a constant distance from
another (`System.arms`) counts by the circle that it follows about that. With d from the other
block to it, t, n the tangent and the normal where the step begins, b = t × n, and κ the curvature
there,

    d = d₀ + t (1 - κc) sin(κa)/κ + n (c cos(κa) + (1 - cos(κa))/κ) + b e:

along the arc by a, inwards by c, and beside it by e. Together these are ξ, and q̇ = J ξ̇. In the
plane the circle is that about the other block; in space it is the one that osculates, about the
axis that the body turns about. A block without an arc counts by its place, ξ = q - q₀.

The other half of the state are canonical momenta, w = Jᵀ p with p = M q̇ (30). J is a tree: what
hangs on a block moves with it, so with Pᵢ the sum of p over block i and all arcs that hang on it,

    w_i = J_iᵀ P_i,   ẇ_i = J_iᵀ Ṗ_i + J̇_iᵀ P_i,   ṗ = Q - Φ_qᵀλ = M q̈,   J_i = [(1 - κc) T, N, b]

with T, N = t, n turned by κa. Constraints and forces do not know of any of this: a stage is
unfolded into q and p, and its q̇ and q̈ are folded into ξ̇ and ẇ.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import FREE, ORIGIN, Arms, Chart, Phase, System, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import Block, add, block, cross, dot, packed, put, subtract
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inlined, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero

# rad in a step: what turns less is as well off with places (1e-10 of the radius, of a radian, with
# rk4), and these cost less
_LEAST = 0.01
_SLOWEST = 1e-4  # of the fastest, in space: a slower block tells no circle
_WIDE = 1.6  # rad: what turns further in a step calls sin and cos both
_SHARPEST = 10.0  # 1 / length of the arm: nor does one that hardly moves about its axis


@inlined
def _apart(unit: Unit, arms: Arms, i: np.uint64, u: Floats) -> Block:
    """u (all blocks D,) of block i, less that of what it turns about."""
    about, v = arms.about[i], block(unit, u, i)
    if about != ORIGIN:
        v = v - block(unit, u, np.uint64(about))
    return v


@inner
def turning(unit: Unit, arms: Arms, phase: Phase) -> float:
    """The fastest that an arm turns, rad/s."""
    fastest = 0.0
    for i in each(0, arms.about.size):
        if arms.about[i] == FREE:
            continue
        d, v = _apart(unit, arms, i, phase.q), _apart(unit, arms, i, phase.qd)
        dd, dv, vv = dot(d, d), dot(d, v), dot(v, v)
        if dd > 0.0:
            fastest = max(fastest, (dd * vv - dv * dv) / (dd * dd))
    return np.sqrt(fastest)


@inner
def lay(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase, h: float) -> None:
    """Choose the coordinates of a step of h (s), and leave ξ̇ and w where it begins."""
    arms = system.arms
    chart.arcs[0] = 0
    slowest = _SLOWEST * largest(phase.qd, work.p.size)
    for i in each(0, arms.about.size):
        chart.curvature[i] = 0.0
        put(chart.rate, i, block(unit, phase.qd, i))
        if arms.about[i] == FREE:
            continue
        d, v = _apart(unit, arms, i, phase.q), _apart(unit, arms, i, phase.qd)
        if len(unit) == 2:
            turn, dd = d[0] * v[1] - d[1] * v[0], dot(d, d)
            if abs(turn) * h <= _LEAST * dd:
                continue
            long = np.sqrt(dd)
            chart.curvature[i] = 1.0 / long
            put(chart.t, i, packed(unit, -d[1] / long, d[0] / long, 0.0))
            put(chart.n, i, (-1.0 / long) * d)
            put(chart.rate, i, packed(unit, turn / long, -dot(d, v) / long, 0.0))
        else:
            b, vv = _apart(unit, arms, i, work.bend), dot(v, v)
            fast, vb = np.sqrt(vv), dot(v, b)
            if fast <= slowest:
                continue
            across = np.sqrt(max(0.0, dot(b, b) * vv - vb * vb)) / fast
            if across * h < _LEAST * fast or across * np.sqrt(dot(d, d)) > _SHARPEST * vv:
                continue
            chart.curvature[i] = across / vv
            t, n = (1.0 / fast) * v, (1.0 / across) * (b - (vb / vv) * v)
            put(chart.t, i, t)
            put(chart.n, i, n)
            put(chart.b, i, cross(t, n))
            put(chart.rate, i, packed(unit, fast, 0.0, 0.0))
        chart.sin[i], chart.cos[i], chart.rho[i] = 0.0, 1.0, 1.0
        chart.arcs[0] += 1
    if chart.arcs[0] > 0:
        _begin(unit, system, chart, work, phase)


@inner
def _begin(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase) -> None:
    """w where the step begins, and what rounding t and n leaves of p beside it: step by step that
    would go the same way."""
    arms, p = system.arms, work.p
    zero(work.sum)
    add_mass_times(unit, system.mass, 1.0, phase.qd, work.sum)
    copy(work.sum, chart.rest)
    gather(unit, arms, chart, work.sum)
    for i in each(0, arms.about.size):
        w = block(unit, work.sum, i)
        if chart.curvature[i] == 0.0:
            put(chart.momentum, i, w)
            put(p, i, w)
        else:
            w = components(unit, chart, i, w)
            put(chart.momentum, i, w)
            put(p, i, composed(unit, chart, i, w))
    scatter(unit, arms, chart, p)
    for a in range(p.size):
        chart.rest[a] -= p[a]


@inlined
def hangs(arms: Arms, chart: Chart, i: np.uint64) -> bool:
    """Whether the arc of block i is about a movable block."""
    about = arms.about[i]
    return chart.curvature[i] != 0.0 and 0 <= about < arms.about.size


@inner
def gather(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """Add to u (movable D,) of each block that of all arcs that hang on it."""
    for m in each(0, arms.order.size):
        i = arms.order[arms.order.size - ONE - m]
        if hangs(arms, chart, i):
            add(u, np.uint64(arms.about[i]), block(unit, u, i))


@inner
def scatter(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """The inverse of `gather`."""
    for m in each(0, arms.order.size):
        i = arms.order[m]
        if hangs(arms, chart, i):
            subtract(u, np.uint64(arms.about[i]), block(unit, u, i))


@inlined
def components(unit: Unit, chart: Chart, i: np.uint64, u: Block) -> Block:
    """u of block i along T, N and b."""
    t, n, b = dot(block(unit, chart.t, i), u), dot(block(unit, chart.n, i), u), 0.0
    if len(unit) != 2:
        b = dot(block(unit, chart.b, i), u)
    sin, cos = chart.sin[i], chart.cos[i]
    return packed(unit, cos * t + sin * n, cos * n - sin * t, b)


@inlined
def composed(unit: Unit, chart: Chart, i: np.uint64, u: Block) -> Block:
    """The inverse of `components`: u₀ T + u₁ N + u₂ b."""
    sin, cos = chart.sin[i], chart.cos[i]
    v = (u[0] * cos - u[1] * sin) * block(unit, chart.t, i)
    v = v + (u[0] * sin + u[1] * cos) * block(unit, chart.n, i)
    if len(unit) != 2:
        v = v + u[2] * block(unit, chart.b, i)
    return v


@inlined
def _third(unit: Unit, u: Block) -> float:
    """What u has besides two coordinates."""
    third = 0.0
    if len(unit) != 2:
        third = u[2]
    return third


@inner
def unfold(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase) -> None:
    """From ξ in q, rates like ξ̇ in q̇, and w in p, of `work`, to q, q̇ and p.

    Prescribed blocks are where they will be. Without arcs p = M q̇.
    """
    p, arms = work.p, system.arms
    if chart.arcs[0] == 0:
        for a in range(p.size):
            work.q[a] += phase.q[a]
        zero(p)
        add_mass_times(unit, system.mass, 1.0, work.qd, p)
        return
    for m in each(0, arms.order.size):
        i = arms.order[m]
        k = chart.curvature[i]
        if k == 0.0:
            add(work.q, i, block(unit, phase.q, i))
            continue
        xi, xid, w = block(unit, work.q, i), block(unit, work.qd, i), block(unit, p, i)
        rho = 1.0 - k * xi[1]
        sin, cos, versine = _turned(k * xi[0])
        chart.sin[i], chart.cos[i], chart.rho[i] = sin, cos, rho
        d = (rho * sin / k) * block(unit, chart.t, i)
        d = d + (xi[1] * cos + versine / k) * block(unit, chart.n, i)
        v = composed(unit, chart, i, packed(unit, rho * xid[0], xid[1], _third(unit, xid)))
        put(p, i, composed(unit, chart, i, packed(unit, w[0] / rho, w[1], _third(unit, w))))
        if len(unit) != 2:
            d = d + xi[2] * block(unit, chart.b, i)
        d = block(unit, phase.q, i) + d
        about = arms.about[i]
        if about != ORIGIN:
            to = np.uint64(about)
            d = d + (block(unit, work.q, to) - block(unit, phase.q, to))
            v = v + block(unit, work.qd, to)
        put(work.q, i, d)
        put(work.qd, i, v)
    scatter(unit, arms, chart, p)
    for a in range(p.size):
        p[a] += chart.rest[a]


@inlined
def _turned(x: float) -> tuple[float, float, float]:
    """sin x, cos x and 1 - cos x; unless x (rad) is large from sin(x/2) alone."""
    if abs(x) > _WIDE:
        cos = np.cos(x)
        return np.sin(x), cos, 1.0 - cos
    half = np.sin(0.5 * x)
    versine = 2.0 * half * half
    return 2.0 * half * np.sqrt(1.0 - half * half), 1.0 - versine, versine


@inner
def lead(unit: Unit, arms: Arms, chart: Chart, work: Work, amount: float) -> None:
    """q += `amount` (s²) times the curvature of the path, where a stage lags behind it by that.

    Arcs do not lag, but are taken along by what they turn about. The stage stands in `target`.
    """
    for m in each(0, arms.order.size):
        i = arms.order[m]
        if chart.curvature[i] == 0.0:
            add(work.q, i, amount * block(unit, work.bend, i))
        elif hangs(arms, chart, i):
            to = np.uint64(arms.about[i])
            add(work.q, i, block(unit, work.q, to) - block(unit, work.target, to))


@inner
def fold(
    unit: Unit, system: System, chart: Chart, work: Work, qd: Floats, qdd: Floats, s: np.uint64
) -> None:
    """ξ̇, ξ̈ and ẇ from q̇ and q̈ of stage s, unfolded last, into `work.k`; w is that of the stage, in
    `chart.w`. Without arcs there is no w."""
    arms, k, n = system.arms, work.k, work.p.size
    blocks = arms.about.size
    if chart.arcs[0] == 0:
        first = s * THREE * n
        for a in range(n):
            k[first + a] = qd[a]
            k[first + n + a] = qdd[a]
        return
    zero(work.sum)
    add_mass_times(unit, system.mass, 1.0, qdd, work.sum)
    gather(unit, arms, chart, work.sum)
    for i in each(0, blocks):
        bent, xi = chart.curvature[i], s * THREE * blocks + i
        xid, wd = xi + blocks, xi + TWO * blocks
        if bent == 0.0:
            put(k, xi, block(unit, qd, i))
            put(k, xid, block(unit, qdd, i))
            put(k, wd, block(unit, work.sum, i))
            continue
        u = components(unit, chart, i, _apart(unit, arms, i, qd))
        v = components(unit, chart, i, _apart(unit, arms, i, qdd))
        P, w = components(unit, chart, i, block(unit, work.sum, i)), block(unit, chart.w, i)
        rho, cd = chart.rho[i], u[1]
        ad = u[0] / rho
        wt, wn = w[0] / rho, w[1]
        put(k, xi, packed(unit, ad, cd, _third(unit, u)))
        along, inward = (v[0] + 2.0 * bent * ad * cd) / rho, v[1] - bent * rho * ad * ad
        put(k, xid, packed(unit, along, inward, _third(unit, v)))
        along, inward = rho * P[0] + bent * (rho * ad * wn - cd * wt), P[1] - bent * ad * wt
        put(k, wd, packed(unit, along, inward, _third(unit, P)))


@inner
def fold_again(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase) -> None:
    """Stage 0 in coordinates that were chosen anew."""
    copy(chart.momentum, chart.w)
    fold(unit, system, chart, work, phase.qd, chart.first, np.uint64(0))


@inner
def straighten(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """A small difference u of ξ (movable D,), where `unfold` was last, as one of q."""
    for m in each(0, arms.order.size):
        i = arms.order[m]
        if chart.curvature[i] != 0.0:
            v = block(unit, u, i)
            v = packed(unit, chart.rho[i] * v[0], v[1], _third(unit, v))
            put(u, i, composed(unit, chart, i, v))
            if hangs(arms, chart, i):
                add(u, i, block(unit, u, np.uint64(arms.about[i])))


@inner
def straighten_momenta(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """A small difference u of w (movable D,), likewise, as one of p."""
    for i in each(0, arms.about.size):
        if chart.curvature[i] != 0.0:
            w = block(unit, u, i)
            w = packed(unit, w[0] / chart.rho[i], w[1], _third(unit, w))
            put(u, i, composed(unit, chart, i, w))
    scatter(unit, arms, chart, u)

"""The coordinates in which a step adds up: arcs for blocks that turn about another, and momenta.

A Runge-Kutta method needs coordinates in which the motion is smooth, nothing else. A point of a
turning bar moves on a circle: a Cartesian coordinate follows every harmonic of this motion, while
the arc length has hardly any acceleration. So, within one step, a block at a constant distance
from another block (`System.arms`) has coordinates along the circle that it follows about the other
block. With d from the other block to it, t, n the tangent and the normal where the step begins,
b = t × n, and κ the curvature there,

    d = d₀ + t (1 - κc) sin(κa)/κ + n (c cos(κa) + (1 - cos(κa))/κ) + b e:

along the arc by a, inwards by c, and beside it by e. Together these are ξ, and q̇ = J ξ̇. In the
plane the circle is that about the other block; in space it is the osculating circle, about the
axis that the body turns about. A block without an arc has ξ = q - q₀.

The other half of the state are canonical momenta, w = Jᵀ p with p = M q̇ (30). J is a tree, because
a block moves with the block that its arc is about. So with Pᵢ the sum of p over block i and all
blocks whose arcs are about it,

    w_i = J_iᵀ P_i,   ẇ_i = J_iᵀ Ṗ_i + J̇_iᵀ P_i,   ṗ = Q - Φ_qᵀλ = M q̈,   J_i = [(1 - κc) T, N, b]

with T, N = t, n turned by κa. Constraints and forces are evaluated in q: a stage is unfolded into
q and p, and its q̇ and q̈ are folded into ξ̇ and ẇ (35).
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import FREE, ORIGIN, Arms, Chart, Phase, System, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import Block, block, cross, dot, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, everywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import add_first, copy, largest, zero
from alf_ros.kernel.steady_axes import mark_steady

# rad in a step: for smaller turns arcs gain 1e-10 of the radius, of a radian, with rk4, and cost
# more than places
_LEAST = 0.01
_SLOWEST = 1e-4  # of the fastest, in space: the circle of a slower block is not determined
_WIDE = 1.6  # rad in a step: for larger turns sin and cos are both computed
# sin x = x + x³ Σ s_k x²ᵏ for |x| <= _WIDE / 2, to 0.7 of a last digit (interpolated at Chebyshev
# nodes). Unlike a sine of the system's library it is plain arithmetic, which has vectors.
_SINE = (
    -0.16666666666666663,
    0.008333333333330467,
    -0.00019841269836043575,
    2.7557315738586845e-06,
    -2.5051057394492127e-08,
    1.5912864224903485e-10,
)
_SHARPEST = 10.0  # 1 / length of the arm: largest curvature that is used


@inlined
def relative(unit: Unit, arms: Arms, i: np.uint64, u: Floats) -> Block:
    """u (all blocks D,) of block i, minus u of the block about which it turns."""
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
        d, v = relative(unit, arms, i, phase.q), relative(unit, arms, i, phase.qd)
        dd, dv, vv = dot(d, d), dot(d, v), dot(v, v)
        fastest = max(fastest, (dd * vv - dv * dv) / pick(dd > 0.0, dd * dd, 1.0))
    return np.sqrt(fastest)


@inner
def choose_arcs(unit: Unit, system: System, work: Work, phase: Phase, h: float) -> bool:
    """Choose the coordinates of a step of h (s), and store ξ̇ where it begins; returns whether
    there are arcs. Then `begin_momenta` follows."""
    arms, chart = system.arms, work.chart
    some = False
    slowest = _SLOWEST * largest(phase.qd, work.p.size)
    if len(unit) != 2:
        mark_steady(unit, arms, phase, work.pull, chart.curvature)
    for i in each(0, arms.about.size):
        steady = chart.curvature[i] > 0.0
        chart.curvature[i] = 0.0
        put(chart.rate, i, block(unit, phase.qd, i))
        if arms.about[i] == FREE:
            continue
        d, v = relative(unit, arms, i, phase.q), relative(unit, arms, i, phase.qd)
        if len(unit) == 2:
            turn, dd = d[0] * v[1] - d[1] * v[0], dot(d, d)
            has = unless(abs(turn) * h <= _LEAST * dd)
            if nowhere(has):
                continue
            radius = np.sqrt(dd)
            curvature = 1.0 / radius
            put(chart.t, i, packed(unit, -curvature * d[1], curvature * d[0], 0.0))
            put(chart.n, i, (-curvature) * d)
            rate = packed(unit, curvature * turn, -curvature * dot(d, v), 0.0)
        else:
            b, vv = relative(unit, arms, i, work.bend), dot(v, v)
            fast, vb = np.sqrt(vv), dot(v, b)
            has = steady & unless(fast <= slowest)
            if nowhere(has):
                continue
            across = np.sqrt(max(0.0, dot(b, b) * vv - vb * vb)) / fast
            has = has & unless(across * h < _LEAST * fast)
            has = has & unless(across * np.sqrt(dot(d, d)) > _SHARPEST * vv)
            if nowhere(has):
                continue
            curvature, radius = across / vv, vv / across
            t, n = (1.0 / fast) * v, (1.0 / across) * (b - (vb / vv) * v)
            put(chart.t, i, t)
            put(chart.n, i, n)
            put(chart.b, i, cross(t, n))
            rate = packed(unit, fast, 0.0, 0.0)
        chart.curvature[i], chart.radius[i] = pick(has, curvature, 0.0), radius
        put(chart.rate, i, pick(has, rate, block(unit, phase.qd, i)))
        chart.sin[i], chart.cos[i] = 0.0, 1.0
        chart.rho[i], chart.per_rho[i] = 1.0, 1.0
        some = some | has
    return some


@inner
def begin_momenta(unit: Unit, system: System, work: Work, phase: Phase, arcs: bool) -> None:
    """w where the step begins (30), and the part of p that w lacks because t and n are rounded:
    without it the error would add up from step to step. Without arcs w does not exist."""
    arms, chart, p = system.arms, work.chart, work.p
    chart.arcs[0] = pick(arcs, 1, 0)
    if nowhere(arcs):
        return
    zero(work.sum)
    add_mass_times(unit, system.mass, 1.0, phase.qd, work.sum)  # (30), σ = 0
    copy(work.sum, chart.rest)
    gather(unit, arms, chart, work.sum)
    for i in each(0, arms.about.size):
        w = block(unit, work.sum, i)
        flat = chart.curvature[i] == 0.0
        if everywhere(flat):
            put(chart.momentum, i, w)
            put(p, i, w)
        else:
            u = components(unit, chart, i, w)
            put(chart.momentum, i, pick(flat, w, u))
            put(p, i, pick(flat, w, composed(unit, chart, i, u)))
    scatter(unit, arms, chart, p)
    for a in range(p.size):
        chart.rest[a] -= p[a]


@inlined
def is_about_movable(arms: Arms, i: np.uint64) -> bool:
    """Whether the arc of block i, if it has one, is about a movable block."""
    about = arms.about[i]
    return 0 <= about < arms.about.size


@inner
def gather(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """Add to u (movable D,) of each block the u of all blocks whose arcs are about it."""
    for m in each(0, arms.order.size):
        i = arms.order[arms.order.size - ONE - m]
        turns = chart.curvature[i] != 0.0
        if is_about_movable(arms, i) and anywhere(turns):
            to = np.uint64(arms.about[i])
            v = block(unit, u, to)
            put(u, to, pick(turns, v + block(unit, u, i), v))


@inner
def scatter(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """The inverse of `gather`."""
    for m in each(0, arms.order.size):
        i = arms.order[m]
        turns = chart.curvature[i] != 0.0
        if is_about_movable(arms, i) and anywhere(turns):
            to = np.uint64(arms.about[i])
            v = block(unit, u, to)
            put(u, to, pick(turns, v - block(unit, u, i), v))


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
    """Third coordinate of u; 0 in the plane."""
    third = 0.0
    if len(unit) != 2:
        third = u[2]
    return third


@inner
def unfold(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """From ξ in q, rates like ξ̇ in q̇, and w in p, of `work`, to q, q̇ and p (30).

    Prescribed blocks have been placed before. Without arcs p = M q̇.
    """
    p, arms, chart = work.p, system.arms, work.chart
    arcs = chart.arcs[0] > 0
    if nowhere(arcs):
        add_first(phase.q, work.q, p.size)
        zero(p)
        add_mass_times(unit, system.mass, 1.0, work.qd, p)  # (30), σ = 0
        return
    for m in each(0, arms.order.size):
        i = arms.order[m]
        k = chart.curvature[i]
        flat, place = k == 0.0, block(unit, work.q, i) + block(unit, phase.q, i)
        if everywhere(flat):
            put(work.q, i, place)
            continue
        xi, xid, w = block(unit, work.q, i), block(unit, work.qd, i), block(unit, p, i)
        rho, radius = 1.0 - k * xi[1], chart.radius[i]
        per_rho = 1.0 / rho
        sin, cos, versine = _turned(k * xi[0])
        chart.sin[i], chart.cos[i] = sin, cos
        chart.rho[i], chart.per_rho[i] = rho, per_rho
        d = (rho * sin * radius) * block(unit, chart.t, i)
        d = d + (xi[1] * cos + versine * radius) * block(unit, chart.n, i)
        v = composed(unit, chart, i, packed(unit, rho * xid[0], xid[1], _third(unit, xid)))
        P = composed(unit, chart, i, packed(unit, w[0] * per_rho, w[1], _third(unit, w)))
        put(p, i, pick(flat, w, P))
        if len(unit) != 2:
            d = d + xi[2] * block(unit, chart.b, i)
        d = block(unit, phase.q, i) + d
        about = arms.about[i]
        if about != ORIGIN:
            to = np.uint64(about)
            d = d + (block(unit, work.q, to) - block(unit, phase.q, to))
            v = v + block(unit, work.qd, to)
        put(work.q, i, pick(flat, place, d))
        put(work.qd, i, pick(flat, xid, v))
    scatter(unit, arms, chart, p)
    for a in range(p.size):
        p[a] += chart.rest[a]
    if not everywhere(arcs):
        zero(work.sum)
        add_mass_times(unit, system.mass, 1.0, work.qd, work.sum)
        for a in range(p.size):
            p[a] = pick(arcs, p[a], work.sum[a])


@inlined
def _turned(x: float) -> tuple[float, float, float]:
    """sin x, cos x and 1 - cos x; unless x (rad) is large from sin(x/2) alone."""
    half, wide = _short_sine(0.5 * x), abs(x) > _WIDE
    versine = 2.0 * half * half
    sin, cos = 2.0 * half * np.sqrt(1.0 - half * half), 1.0 - versine
    if anywhere(wide):
        sin, cos = pick(wide, np.sin(x), sin), pick(wide, np.cos(x), cos)
        versine = pick(wide, 1.0 - cos, versine)
    return sin, cos, versine


@inlined
def _short_sine(x: float) -> float:
    """sin x of |x| <= _WIDE / 2; anything else is of no use."""
    z = x * x
    first, second = _SINE[0] + z * _SINE[1], _SINE[2] + z * _SINE[3]
    return x + x * z * (first + z * z * (second + z * z * (_SINE[4] + z * _SINE[5])))


@inner
def shift_along_path(unit: Unit, arms: Arms, work: Work, amount: float) -> None:
    """q += `amount` (s²) times the curvature of the path, by which a stage lags behind the path.

    Blocks with arcs do not lag; they move with the block that they turn about. Leaves the stage in
    `target`.
    """
    chart = work.chart
    for m in each(0, arms.order.size):
        i = arms.order[m]
        flat = chart.curvature[i] == 0.0
        place = block(unit, work.q, i)
        put(work.target, i, place)
        ahead = place + amount * block(unit, work.bend, i)
        if everywhere(flat):
            put(work.q, i, ahead)
            continue
        if is_about_movable(arms, i):
            to = np.uint64(arms.about[i])
            place = place + (block(unit, work.q, to) - block(unit, work.target, to))
        put(work.q, i, pick(flat, ahead, place))


@inner
def fold(unit: Unit, system: System, work: Work, qd: Floats, qdd: Floats, s: np.uint64) -> None:
    """ξ̇, ξ̈ and ẇ (35) from q̇ and q̈ of stage s, unfolded last, into `work.k`; w belongs to the
    stage, in `chart.w`. Without arcs w does not exist."""
    arms, chart, k, n = system.arms, work.chart, work.k, work.p.size
    blocks = arms.about.size
    if nowhere(chart.arcs[0] > 0):
        first = s * THREE * n
        for a in range(n):
            k[first + a] = qd[a]
            k[first + n + a] = qdd[a]
        return
    zero(work.sum)
    add_mass_times(unit, system.mass, 1.0, qdd, work.sum)  # ṗ, (35)
    gather(unit, arms, chart, work.sum)
    for i in each(0, blocks):
        bent, xi = chart.curvature[i], s * THREE * blocks + i
        xid, wd = xi + blocks, xi + TWO * blocks
        flat = bent == 0.0
        a, b, c = block(unit, qd, i), block(unit, qdd, i), block(unit, work.sum, i)
        if everywhere(flat):
            put(k, xi, a)
            put(k, xid, b)
            put(k, wd, c)
            continue
        u = components(unit, chart, i, relative(unit, arms, i, qd))
        v = components(unit, chart, i, relative(unit, arms, i, qdd))
        P, w = components(unit, chart, i, c), block(unit, chart.w, i)
        rho, per_rho, cd = chart.rho[i], chart.per_rho[i], u[1]
        ad = u[0] * per_rho
        wt, wn = w[0] * per_rho, w[1]
        put(k, xi, pick(flat, a, packed(unit, ad, cd, _third(unit, u))))
        along, inward = (v[0] + 2.0 * bent * ad * cd) * per_rho, v[1] - bent * rho * ad * ad
        put(k, xid, pick(flat, b, packed(unit, along, inward, _third(unit, v))))
        along, inward = rho * P[0] + bent * (rho * ad * wn - cd * wt), P[1] - bent * ad * wt
        put(k, wd, pick(flat, c, packed(unit, along, inward, _third(unit, P))))


@inner
def fold_first(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """Fold stage 0 again, in newly chosen coordinates."""
    copy(work.chart.momentum, work.chart.w)
    fold(unit, system, work, phase.qd, work.chart.first, np.uint64(0))


@inner
def straighten(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """A small difference u of ξ (movable D,), where `unfold` was last, as one of q."""
    for m in each(0, arms.order.size):
        i = arms.order[m]
        turns = chart.curvature[i] != 0.0
        if anywhere(turns):
            small = block(unit, u, i)
            v = packed(unit, chart.rho[i] * small[0], small[1], _third(unit, small))
            v = composed(unit, chart, i, v)
            if is_about_movable(arms, i):
                v = v + block(unit, u, np.uint64(arms.about[i]))
            put(u, i, pick(turns, v, small))


@inner
def straighten_momenta(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """A small difference u of w (movable D,), likewise, as one of p."""
    for i in each(0, arms.about.size):
        turns = chart.curvature[i] != 0.0
        if anywhere(turns):
            small = block(unit, u, i)
            w = packed(unit, small[0] / chart.rho[i], small[1], _third(unit, small))
            put(u, i, pick(turns, composed(unit, chart, i, w), small))
    scatter(unit, arms, chart, u)

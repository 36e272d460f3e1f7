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
from alf_ros.kernel.data import FREE, ONE, ORIGIN, THREE, TWO, Arms, Chart, Phase, System, Work
from alf_ros.kernel.jit import inner
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.vectors import copy, largest, zero

# rad in a step: what turns less is as well off with places (1e-10 of the radius, of a radian, with
# rk4), and these cost less
_LEAST = 0.01
_SLOWEST = 1e-4  # of the fastest, in space: a slower block tells no circle
_SHARPEST = 10.0  # 1 / length of the arm: nor does one that hardly moves about its axis


@inner
def _apart(unit: Unit, arms: Arms, i: np.uint64, u: Floats, out: Floats) -> None:
    """out (D,) = u (all blocks D,) of block i, less that of what it turns about."""
    D, about = np.uint64(len(unit)), arms.about[i]
    for a in range(D):
        out[a] = u[i * D + a]
        if about != ORIGIN:
            out[a] -= u[np.uint64(about) * D + a]


@inner
def turning(unit: Unit, arms: Arms, chart: Chart, phase: Phase) -> float:
    """The fastest that an arm turns, rad/s."""
    d, v, fastest = chart.d, chart.v, 0.0
    for i in range(arms.about.size):
        if arms.about[i] == FREE:
            continue
        _apart(unit, arms, i, phase.q, d)
        _apart(unit, arms, i, phase.qd, v)
        dd, dv, vv = 0.0, 0.0, 0.0
        for a in range(len(unit)):
            dd, dv, vv = dd + d[a] * d[a], dv + d[a] * v[a], vv + v[a] * v[a]
        if dd > 0.0:
            fastest = max(fastest, (dd * vv - dv * dv) / (dd * dd))
    return np.sqrt(fastest)


@inner
def lay(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase, h: float) -> None:
    """Choose the coordinates of a step of h (s), and leave ξ̇ and w where it begins."""
    D, arms = np.uint64(len(unit)), system.arms
    chart.arcs[0] = 0
    slowest = _SLOWEST * largest(phase.qd, work.p.size)
    d, v, b = chart.d, chart.v, chart.bent
    for i in range(arms.about.size):
        x = i * D
        chart.curvature[i] = 0.0
        for a in range(x, x + D):
            chart.rate[a] = phase.qd[a]
        if arms.about[i] == FREE:
            continue
        _apart(unit, arms, i, phase.q, d)
        _apart(unit, arms, i, phase.qd, v)
        _apart(unit, arms, i, work.bend, b)
        dd, dv, vv, vb, bb = 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(D):
            dd, dv, vv = dd + d[a] * d[a], dv + d[a] * v[a], vv + v[a] * v[a]
            vb, bb = vb + v[a] * b[a], bb + b[a] * b[a]
        if D == TWO:
            turn = d[0] * v[1] - d[1] * v[0]
            if abs(turn) * h <= _LEAST * dd:
                continue
            long = np.sqrt(dd)
            chart.curvature[i] = 1.0 / long
            chart.t[x], chart.t[x + ONE] = -d[1] / long, d[0] / long
            chart.n[x], chart.n[x + ONE] = -d[0] / long, -d[1] / long
            chart.rate[x], chart.rate[x + ONE] = turn / long, -dv / long
        else:
            fast = np.sqrt(vv)
            if fast <= slowest:
                continue
            across = np.sqrt(max(0.0, bb * vv - vb * vb)) / fast
            if across * h < _LEAST * fast or across * np.sqrt(dd) > _SHARPEST * vv:
                continue
            chart.curvature[i] = across / vv
            for a in range(D):
                chart.t[x + a] = v[a] / fast
                chart.n[x + a] = (b[a] - vb / vv * v[a]) / across
                chart.rate[x + a] = 0.0
            chart.rate[x] = fast
            y, z = x + ONE, x + TWO
            t, n = chart.t, chart.n
            chart.b[x] = t[y] * n[z] - t[z] * n[y]
            chart.b[y] = t[z] * n[x] - t[x] * n[z]
            chart.b[z] = t[x] * n[y] - t[y] * n[x]
        chart.sin[i], chart.cos[i], chart.rho[i] = 0.0, 1.0, 1.0
        chart.arcs[0] += 1
    if chart.arcs[0] > 0:
        _begin(unit, system, chart, work, phase)


@inner
def _begin(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase) -> None:
    """w where the step begins, and what rounding t and n leaves of p beside it: step by step that
    would go the same way."""
    D, arms, w, p = np.uint64(len(unit)), system.arms, chart.momentum, work.p
    zero(work.sum)
    add_mass_times(unit, system.mass, 1.0, phase.qd, work.sum)
    copy(work.sum, chart.rest)
    gather(unit, arms, chart, work.sum)
    copy(work.sum, p)
    for i in range(arms.about.size):
        x, e = i * D, 0.0
        if chart.curvature[i] != 0.0:
            w[x], w[x + ONE], e = components(unit, chart, i, work.sum, x)
            if D != TWO:
                w[x + TWO] = e
            compose(unit, chart, i, w[x], w[x + ONE], e, p)
        else:
            for a in range(x, x + D):
                w[a] = p[a]
    scatter(unit, arms, chart, p)
    for a in range(p.size):
        chart.rest[a] -= p[a]


@inner
def hangs(arms: Arms, chart: Chart, i: np.uint64) -> bool:
    """Whether the arc of block i is about a movable block."""
    about = arms.about[i]
    return chart.curvature[i] != 0.0 and 0 <= about < arms.about.size


@inner
def gather(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """Add to u (movable D,) of each block that of all arcs that hang on it."""
    D = np.uint64(len(unit))
    for m in range(arms.order.size):
        i = arms.order[arms.order.size - ONE - m]
        if hangs(arms, chart, i):
            for a in range(D):
                u[np.uint64(arms.about[i]) * D + a] += u[i * D + a]


@inner
def scatter(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """The inverse of `gather`."""
    D = np.uint64(len(unit))
    for m in range(arms.order.size):
        i = arms.order[m]
        if hangs(arms, chart, i):
            for a in range(D):
                u[np.uint64(arms.about[i]) * D + a] -= u[i * D + a]


@inner
def components(
    unit: Unit, chart: Chart, i: np.uint64, u: Floats, x: np.uint64
) -> tuple[float, float, float]:
    """Along T, N and b of block i: of u, from x on."""
    t, n, b = 0.0, 0.0, 0.0
    D = np.uint64(len(unit))
    for a in range(D):
        t += chart.t[i * D + a] * u[x + a]
        n += chart.n[i * D + a] * u[x + a]
        if D != TWO:
            b += chart.b[i * D + a] * u[x + a]
    sin, cos = chart.sin[i], chart.cos[i]
    return cos * t + sin * n, cos * n - sin * t, b


@inner
def compose(
    unit: Unit, chart: Chart, i: np.uint64, t: float, n: float, b: float, u: Floats
) -> None:
    """u of block i = t T + n N + b b."""
    D = np.uint64(len(unit))
    sin, cos = chart.sin[i], chart.cos[i]
    along, across = t * cos - n * sin, t * sin + n * cos
    for at in range(i * D, i * D + D):
        u[at] = chart.t[at] * along + chart.n[at] * across
        if D != TWO:
            u[at] += chart.b[at] * b


@inner
def unfold(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase) -> None:
    """From ξ in q, rates like ξ̇ in q̇, and w in p, of `work`, to q, q̇ and p.

    Prescribed blocks are where they will be. Without arcs p = M q̇.
    """
    D, p, arms = np.uint64(len(unit)), work.p, system.arms
    if chart.arcs[0] == 0:
        for a in range(p.size):
            work.q[a] += phase.q[a]
        zero(p)
        add_mass_times(unit, system.mass, 1.0, work.qd, p)
        return
    for m in range(arms.order.size):
        i = arms.order[m]
        k, x = chart.curvature[i], i * D
        if k == 0.0:
            for a in range(x, x + D):
                work.q[a] += phase.q[a]
            continue
        a, c, e, ad, cd, ed = work.q[x], work.q[x + ONE], 0.0, work.qd[x], work.qd[x + ONE], 0.0
        pa, pc, pe = p[x], p[x + ONE], 0.0
        if D != TWO:
            e, ed, pe = work.q[x + TWO], work.qd[x + TWO], p[x + TWO]
        sin, cos, rho = np.sin(k * a), np.cos(k * a), 1.0 - k * c
        chart.sin[i], chart.cos[i], chart.rho[i] = sin, cos, rho
        t, n = rho * sin / k, c * cos + (1.0 - cos) / k
        for at in range(x, x + D):
            work.q[at] = phase.q[at] + chart.t[at] * t + chart.n[at] * n
            if D != TWO:
                work.q[at] += chart.b[at] * e
        compose(unit, chart, i, rho * ad, cd, ed, work.qd)
        compose(unit, chart, i, pa / rho, pc, pe, p)
        about = arms.about[i]
        if about != ORIGIN:
            to = np.uint64(about) * D
            for a in range(D):
                work.q[x + a] += work.q[to + a] - phase.q[to + a]
                work.qd[x + a] += work.qd[to + a]
    scatter(unit, arms, chart, p)
    for a in range(p.size):
        p[a] += chart.rest[a]


@inner
def lead(unit: Unit, arms: Arms, chart: Chart, work: Work, amount: float) -> None:
    """q += `amount` (s²) times the curvature of the path, where a stage lags behind it by that.

    Arcs do not lag, but are taken along by what they turn about. The stage stands in `target`.
    """
    D = np.uint64(len(unit))
    for m in range(arms.order.size):
        i = arms.order[m]
        x = i * D
        if chart.curvature[i] == 0.0:
            for a in range(x, x + D):
                work.q[a] += amount * work.bend[a]
        elif hangs(arms, chart, i):
            to = np.uint64(arms.about[i]) * D
            for a in range(D):
                work.q[x + a] += work.q[to + a] - work.target[to + a]


@inner
def fold(
    unit: Unit, system: System, chart: Chart, work: Work, qd: Floats, qdd: Floats, s: np.uint64
) -> None:
    """ξ̇, ξ̈ and ẇ from q̇ and q̈ of stage s, unfolded last, into `work.k`; w is that of the stage, in
    `chart.w`. Without arcs there is no w."""
    D, arms, w, u, v = np.uint64(len(unit)), system.arms, chart.w, chart.d, chart.v
    k, n = work.k, work.p.size
    first = s * THREE * n
    if chart.arcs[0] == 0:
        for a in range(n):
            k[first + a] = qd[a]
            k[first + n + a] = qdd[a]
        return
    zero(work.sum)
    add_mass_times(unit, system.mass, 1.0, qdd, work.sum)
    gather(unit, arms, chart, work.sum)
    for i in range(arms.about.size):
        bent, x = chart.curvature[i], i * D
        xi = first + x
        xid, wd = xi + n, xi + TWO * n
        if bent == 0.0:
            for a in range(D):
                k[xi + a], k[xid + a], k[wd + a] = qd[x + a], qdd[x + a], work.sum[x + a]
            continue
        _apart(unit, arms, i, qd, u)
        _apart(unit, arms, i, qdd, v)
        along, cd, ed = components(unit, chart, i, u, np.uint64(0))
        more, cdd, edd = components(unit, chart, i, v, np.uint64(0))
        pt, pn, pb = components(unit, chart, i, work.sum, x)
        rho = chart.rho[i]
        ad = along / rho
        wt, wn = w[x] / rho, w[x + ONE]
        k[xi], k[xi + ONE] = ad, cd
        k[xid] = (more + 2.0 * bent * ad * cd) / rho
        k[xid + ONE] = cdd - bent * rho * ad * ad
        k[wd] = rho * pt + bent * (rho * ad * wn - cd * wt)
        k[wd + ONE] = pn - bent * ad * wt
        if D != TWO:
            k[xi + TWO], k[xid + TWO], k[wd + TWO] = ed, edd, pb


@inner
def fold_again(unit: Unit, system: System, chart: Chart, work: Work, phase: Phase) -> None:
    """Stage 0 in coordinates that were chosen anew."""
    copy(chart.momentum, chart.w)
    fold(unit, system, chart, work, phase.qd, chart.first, np.uint64(0))


@inner
def straighten(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """A small difference u of ξ (movable D,), where `unfold` was last, as one of q."""
    D = np.uint64(len(unit))
    for m in range(arms.order.size):
        i = arms.order[m]
        if chart.curvature[i] != 0.0:
            x, e = i * D, 0.0
            if D != TWO:
                e = u[x + TWO]
            compose(unit, chart, i, chart.rho[i] * u[x], u[x + ONE], e, u)
            if hangs(arms, chart, i):
                for a in range(D):
                    u[x + a] += u[np.uint64(arms.about[i]) * D + a]


@inner
def straighten_momenta(unit: Unit, arms: Arms, chart: Chart, u: Floats) -> None:
    """A small difference u of w (movable D,), likewise, as one of p."""
    D = np.uint64(len(unit))
    for i in range(arms.about.size):
        if chart.curvature[i] != 0.0:
            x, e = i * D, 0.0
            if D != TWO:
                e = u[x + TWO]
            compose(unit, chart, i, u[x] / chart.rho[i], u[x + ONE], e, u)
    scatter(unit, arms, chart, u)

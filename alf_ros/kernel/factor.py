"""A = M + Φ_qᵀ α Φ_q on its pattern, its LDLᵀ, and solves with it."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import gradients
from alf_ros.kernel.data import FOUR, ONE, TWO, ZERO, Pattern, System, Work
from alf_ros.kernel.jit import compiled, inlined, inner
from alf_ros.kernel.soft import add_soft
from alf_ros.kernel.vectors import copy


@inner
def assemble(unit: Unit, system: System, work: Work, q: Floats) -> None:
    """Φ_q at q, in `gf` and `g2f`, and A = M + Φ_qᵀ α Φ_q on the pattern: of the diagonal blocks
    the lower triangles."""
    D = np.uint64(len(unit))
    rows, pattern, g, g2 = system.rows, system.pattern, work.gf, work.g2f
    diagonal, off = work.diagonal, work.off
    copy(pattern.mass_diagonal, work.diagonal)
    copy(pattern.mass_off, work.off)
    if system.soft.weight.size > 0:
        add_soft(unit, system.soft, work.diagonal, work.off)
    DD, m1 = D * D, rows.i.size
    for r in range(m1):
        i, j, both = rows.i[r], rows.j[r], r < rows.both
        for a in range(D):
            g[r * D + a] = q[i * D + a] - q[j * D + a]
        at = pattern.distance[r] * DD if both else ZERO
        for a in range(D):
            s = rows.alpha[r] * g[r * D + a]
            for c in range(D):
                v = s * g[r * D + c]
                if c <= a:
                    diagonal[i * DD + a * D + c] += v
                if both:
                    off[at + a * D + c] -= v
                    if c <= a:
                        diagonal[j * DD + a * D + c] += v
    gradients(unit, rows, q, g2)
    for r in range(rows.movable.size):
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * DD
            for a in range(D):
                for c in range(a + ONE):
                    diagonal[i + a * D + c] += rows.alpha[m1 + r] * g2[e * D + a] * g2[e * D + c]
    pair = pattern.pair
    for n in range(np.uint64(0), pair.size, FOUR):
        e, f, at, r = pair[n], pair[n + ONE], pair[n + TWO], pair[n + TWO + ONE]
        for a in range(D):
            for c in range(D):
                off[at * DD + a * D + c] += rows.alpha[r] * g2[e * D + a] * g2[f * D + c]


@inner
def factorise(
    unit: Unit,
    pattern: Pattern,
    diagonal: Floats,
    off: Floats,
    column: Floats,
    x: Floats | None,
) -> int:
    """A = L D Lᵀ in place, right-looking by blocks; returns the number of columns that went well.

    On the way x = L⁻¹ x, if there is one: that hardly costs more, as columns wait for each other.

    Inside a block the elimination is by scalars: a 2x2 or 3x3 inverse would lose the digits that
    the spread between α and M needs. What is used again is kept out of memory, where the next
    column would have to wait for it.
    """
    D = np.uint64(len(unit))
    DD = D * D
    u = np.uint64(0)
    for k in range(pattern.first.size - ONE):
        kk = k * DD
        l20, l21, d2 = 0.0, 0.0, 1.0
        pivot = diagonal[kk]
        d0 = 1.0 / pivot
        l10 = diagonal[kk + D] * d0
        second = diagonal[kk + D + ONE] - diagonal[kk + D] * l10
        d1 = 1.0 / second
        good = pivot > 0.0 and second > 0.0
        diagonal[kk], diagonal[kk + D], diagonal[kk + D + ONE] = d0, l10, d1
        if D != TWO:
            at = kk + TWO * D
            l20 = diagonal[at] * d0
            rest = diagonal[at + ONE] - diagonal[at] * l10
            l21 = rest * d1
            third = diagonal[at + TWO] - diagonal[at] * l20 - rest * l21
            d2 = 1.0 / third
            good = good and third > 0.0
            diagonal[at], diagonal[at + ONE], diagonal[at + TWO] = l20, l21, d2
        if not good:
            return k
        start = pattern.first[k]
        for n in range(pattern.first[k + ONE] - start):
            at, un = (start + n) * DD, n * DD
            for a in range(D):
                row = at + a * D
                u0 = off[row]  # U = A_ik L_kk⁻ᵀ, L_ik = U D⁻¹
                u1 = off[row + ONE] - u0 * l10
                column[un + a * D], column[un + a * D + ONE] = u0, u1
                off[row], off[row + ONE] = u0 * d0, u1 * d1
                if D != TWO:
                    u2 = off[row + TWO] - u0 * l20 - u1 * l21
                    column[un + a * D + TWO] = u2
                    off[row + TWO] = u2 * d2
            for m in range(n):
                to, um = pattern.target[u] * DD, m * DD
                u += ONE
                for a in range(D):
                    for b in range(D):  # A_ij -= L_ik U_jkᵀ
                        off[to + a * D + b] -= inner_product(
                            D, off, at + a * D, column, um + b * D
                        )
            to = pattern.row[start + n] * DD
            for a in range(D):
                for b in range(a + ONE):
                    diagonal[to + a * D + b] -= inner_product(
                        D, off, at + a * D, column, un + b * D
                    )
        if x is not None:  # known when it is compiled
            _eliminate(unit, pattern, diagonal, off, k, x)
    return pattern.first.size - ONE


@inlined
def inner_product(D: np.uint64, u: Floats, i: np.uint64, v: Floats, j: np.uint64) -> float:
    """The inner product of the D numbers of u from i on and those of v from j on."""
    s = u[i] * v[j] + u[i + ONE] * v[j + ONE]
    if D != TWO:
        s += u[i + TWO] * v[j + TWO]
    return s


@inlined
def _eliminate(
    unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, k: np.uint64, x: Floats
) -> None:
    """Column k of x = L⁻¹ x."""
    D = np.uint64(len(unit))
    i, kk, x2 = k * D, k * D * D, 0.0
    x0 = x[i]
    x1 = x[i + ONE] - diagonal[kk + D] * x0
    x[i + ONE] = x1
    if D != TWO:
        at = kk + TWO * D
        x2 = x[i + TWO] - diagonal[at] * x0 - diagonal[at + ONE] * x1
        x[i + TWO] = x2
    for e in range(pattern.first[k], pattern.first[k + ONE]):
        to = pattern.row[e] * D
        for a in range(D):
            at = (e * D + a) * D
            s = x[to + a] - off[at] * x0 - off[at + ONE] * x1
            if D != TWO:
                s -= off[at + TWO] * x2
            x[to + a] = s


@inlined
def _substitute(
    unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, k: np.uint64, x: Floats
) -> None:
    """Column k of x = L⁻ᵀ D⁻¹ x."""
    D = np.uint64(len(unit))
    i, kk, x2 = k * D, k * D * D, 0.0
    x0, x1 = x[i] * diagonal[kk], x[i + ONE] * diagonal[kk + D + ONE]
    if D != TWO:
        x2 = x[i + TWO] * diagonal[kk + TWO * D + TWO]
    for e in range(pattern.first[k], pattern.first[k + ONE]):
        of = pattern.row[e] * D
        for a in range(D):
            at, s = (e * D + a) * D, x[of + a]
            x0 -= off[at] * s
            x1 -= off[at + ONE] * s
            if D != TWO:
                x2 -= off[at + TWO] * s
    if D != TWO:
        at = kk + TWO * D
        x0, x1 = x0 - diagonal[at] * x2, x1 - diagonal[at + ONE] * x2
        x[i + TWO] = x2
    x[i], x[i + ONE] = x0 - diagonal[kk + D] * x1, x1


@compiled
def solve(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, x: Floats) -> None:
    """x = A⁻¹ x."""
    n = pattern.first.size - ONE
    for k in range(n):
        _eliminate(unit, pattern, diagonal, off, k, x)
    for back in range(n):
        _substitute(unit, pattern, diagonal, off, n - ONE - back, x)


@inner
def step_by(unit: Unit, system: System, work: Work, x: Floats) -> tuple[float, float]:
    """δ = A⁻¹ δ, x += δ; returns the largest of δ and of x. In one pass, for the same reason."""
    D, pattern, delta = np.uint64(len(unit)), system.pattern, work.delta
    diagonal, off = work.diagonal, work.off
    n, step, size = pattern.first.size - ONE, 0.0, 0.0
    for k in range(n):
        _eliminate(unit, pattern, diagonal, off, k, delta)
    for back in range(n):
        k = n - ONE - back
        _substitute(unit, pattern, diagonal, off, k, delta)
        for a in range(k * D, k * D + D):
            d = delta[a]
            x[a] += d
            step, size = max(step, abs(d)), max(size, abs(x[a]))
    return step, size


@inner
def solve_on(unit: Unit, system: System, work: Work) -> bool:
    """δ = A⁻¹ δ with A as `assemble` left it; returns whether A was positive definite."""
    pattern, diagonal, off = system.pattern, work.diagonal, work.off
    n = pattern.first.size - ONE
    columns = factorise(unit, pattern, diagonal, off, work.column, work.delta)
    for back in range(n):
        _substitute(unit, pattern, diagonal, off, n - ONE - back, work.delta)
    return columns == n


@compiled
def linearise(unit: Unit, system: System, work: Work, q: Floats) -> bool:
    """Φ_q and the factor of A at q; returns whether A was positive definite."""
    assemble(unit, system, work, q)
    copy(work.gf, work.g)
    copy(work.g2f, work.g2)
    pattern = system.pattern
    columns = factorise(unit, pattern, work.diagonal, work.off, work.column, None)
    return columns == pattern.first.size - ONE

"""The leading matrix A = M + Φ_qᵀ α Φ_q of (26), (33) on its pattern, its LDLᵀ, and solves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import gradients
from alf_ros.kernel.data import Pattern, System, Work
from alf_ros.kernel.effect_jacobians import add_soft
from alf_ros.kernel.numba_ext.block import Block, add, add_outer, block, dot, packed, put, subtract
from alf_ros.kernel.numba_ext.jit import FOUR, ONE, TWO, ZERO, compiled, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import nowhere
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.triangular_solve import eliminate, upper

Triangle = tuple[float, float, float, float, float, float]


class Pivot(NamedTuple):
    """Factor of a pivot block: entries of L below the diagonal, and reciprocal pivots D⁻¹."""

    l10: float
    l20: float
    l21: float
    d0: float
    d1: float
    d2: float


@inner
def assemble(unit: Unit, system: System, work: Work, q: Floats) -> None:
    """Φ_q at q, in `gf` and `g2f`, and A = M + Φ_qᵀ α Φ_q on the pattern: of the diagonal blocks
    the lower triangles count."""
    D = np.uint64(len(unit))
    rows, pattern, g, g2 = system.rows, system.pattern, work.gf, work.g2f
    diagonal, off, m1 = work.diagonal, work.off, rows.i.size
    copy(pattern.mass_diagonal, diagonal)
    copy(pattern.mass_off, off)
    if system.soft.weight.size > 0:
        add_soft(unit, system.soft, diagonal, off)
    for r in each(0, m1):
        i, j, both = rows.i[r], rows.j[r], r < rows.both
        d = block(unit, q, i) - block(unit, q, j)
        put(g, r, d)
        at = pattern.distance[r] if both else ZERO
        for a in range(D):
            v = (rows.alpha[r] * d[a]) * d
            add(diagonal, i * D + a, v)
            if both:
                subtract(off, at * D + a, v)
                add(diagonal, j * D + a, v)
    gradients(unit, rows, q, g2)
    for r in each(0, rows.movable.size):
        for e in each(rows.first[r], rows.movable[r]):
            d = block(unit, g2, e)
            add_outer(unit, diagonal, rows.block[e], rows.alpha[m1 + r] * d, d)
    pair = pattern.pair
    for n in range(np.uint64(0), pair.size, FOUR):
        e, f, at, r = pair[n], pair[n + ONE], pair[n + TWO], pair[n + TWO + ONE]
        add_outer(unit, off, at, rows.alpha[r] * block(unit, g2, e), block(unit, g2, f))


@inlined
def _triangle(unit: Unit, diagonal: Floats, k: np.uint64) -> Triangle:
    """The lower triangle of diagonal block k, by rows; in the plane the second row twice."""
    D = np.uint64(len(unit))
    first, second, third = k * D * D, k * D * D + D, (k + ONE) * D * D - D
    return (
        diagonal[first],
        diagonal[second],
        diagonal[second + ONE],
        diagonal[third],
        diagonal[third + ONE],
        diagonal[third + D - ONE],
    )


@inner
def factorise(
    unit: Unit,
    pattern: Pattern,
    diagonal: Floats,
    off: Floats,
    column: Floats,
    x: Floats | None,
) -> int:
    """A = L D Lᵀ in place, right-looking by blocks; returns the number of columns with a positive
    pivot block before the first without. Of lanes the last one counts: see `are_factored`.

    If x is given, x = L⁻¹ x as well: this costs little, because columns wait for each other.

    Inside a block the elimination is by scalars: a 2x2 or 3x3 inverse would lose the digits that
    the spread between α and M needs. The next two pivot blocks are held in registers, because
    their columns would wait for memory.
    """
    D, n = np.uint64(len(unit)), pattern.first.size - ONE
    DD, u = D * D, ZERO
    if n == ZERO:
        return n
    here = after = _triangle(unit, diagonal, ZERO)
    if n > ONE:
        after = _triangle(unit, diagonal, ONE)
    for k in each(0, n):
        kk = k * DD
        a00, a10, a11, a20, a21, a22 = here
        here = after
        if k + TWO < n:
            after = _triangle(unit, diagonal, k + TWO)
        l20, l21, d2 = 0.0, 0.0, 1.0
        minor = a00 * a11 - a10 * a10
        d0, d1 = 1.0 / a00, a00 / minor
        l10 = a10 * d0
        good = (a00 > 0.0) & (minor > 0.0) & (minor < np.inf)
        diagonal[kk], diagonal[kk + D], diagonal[kk + D + ONE] = d0, l10, d1
        if D != TWO:
            at = kk + TWO * D
            l20 = a20 * d0
            rest = a21 - a20 * l10
            l21 = rest * d1
            third = a22 - a20 * l20 - rest * l21
            d2 = 1.0 / third
            good = good & (third > 0.0)
            diagonal[at], diagonal[at + ONE], diagonal[at + TWO] = l20, l21, d2
        if nowhere(good):
            return k
        pivot = Pivot(l10, l20, l21, d0, d1, d2)
        first = np.uint64(pattern.first[k])
        for e in each(first, pattern.first[k + ONE]):
            U0, L0 = _divided(unit, off, e * D, pivot)
            U1, L1 = _divided(unit, off, e * D + ONE, pivot)
            U2, L2 = U1, L1
            if D != TWO:
                U2, L2 = _divided(unit, off, e * D + TWO, pivot)
            un = (e - first) * D
            put(column, un, U0)
            put(column, un + ONE, U1)
            if D != TWO:
                put(column, un + TWO, U2)
            for m in each(0, e - first):
                to = pattern.target[u] * D
                u += ONE
                um = m * D
                c0, c1 = block(unit, column, um), block(unit, column, um + ONE)
                c2 = block(unit, column, um + D - ONE)
                # A_ij -= L_ik U_jkᵀ
                subtract(off, to, packed(unit, dot(L0, c0), dot(L0, c1), dot(L0, c2)))
                subtract(off, to + ONE, packed(unit, dot(L1, c0), dot(L1, c1), dot(L1, c2)))
                if D != TWO:
                    subtract(off, to + TWO, packed(unit, dot(L2, c0), dot(L2, c1), dot(L2, c2)))
            to = np.uint64(pattern.row[e])
            less = dot(L0, U0), dot(L1, U0), dot(L1, U1), dot(L2, U0), dot(L2, U1), dot(L2, U2)
            if to == k + TWO:
                after = _difference(after, less)
            elif to == k + ONE:
                here = _difference(here, less)
            else:
                at = to * DD
                diagonal[at] -= less[0]
                diagonal[at + D] -= less[1]
                diagonal[at + D + ONE] -= less[2]
                if D != TWO:
                    at += TWO * D
                    diagonal[at] -= less[3]
                    diagonal[at + ONE] -= less[4]
                    diagonal[at + TWO] -= less[5]
        if x is not None:  # known when it is compiled
            eliminate(unit, pattern, diagonal, off, k, x)
    return n


@inlined
def _divided(unit: Unit, off: Floats, row: np.uint64, pivot: Pivot) -> tuple[Block, Block]:
    """A row of U = A_ik L_kk⁻ᵀ, and of L_ik = U D⁻¹, which replaces the row of A_ik."""
    D = np.uint64(len(unit))
    at = row * D
    u0 = off[at]
    u1, u2 = off[at + ONE] - u0 * pivot.l10, 0.0
    if D != TWO:
        u2 = off[at + TWO] - u0 * pivot.l20 - u1 * pivot.l21
    L = packed(unit, u0 * pivot.d0, u1 * pivot.d1, u2 * pivot.d2)
    put(off, row, L)
    return packed(unit, u0, u1, u2), L


@inlined
def _difference(a: Triangle, b: Triangle) -> Triangle:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5]


@inner
def solve_on(unit: Unit, system: System, work: Work) -> bool:
    """δ = A⁻¹ δ with A as `assemble` left it; returns whether A was positive definite."""
    pattern, diagonal, off = system.pattern, work.diagonal, work.off
    n = pattern.first.size - ONE
    columns = factorise(unit, pattern, diagonal, off, work.column, work.delta)
    upper(unit, pattern, diagonal, off, work.delta)
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

"""A = M + Φ_qᵀ α Φ_q on its pattern, its LDLᵀ, and solves with it."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import jacobian
from alf_ros.kernel.data import FOUR, ONE, TWO, Pattern, System, Work
from alf_ros.kernel.jit import compiled, inner
from alf_ros.kernel.soft import add_soft
from alf_ros.kernel.vectors import copy


@inner
def assemble(unit: Unit, system: System, work: Work) -> None:
    """A = M + Φ_qᵀ α Φ_q on the pattern, lower blocks, from the Jacobian in `work`."""
    D = np.uint64(len(unit))
    rows, pattern, g, g2 = system.rows, system.pattern, work.g, work.g2
    diagonal, off = work.diagonal, work.off
    copy(pattern.mass_diagonal, work.diagonal)
    copy(pattern.mass_off, work.off)
    add_soft(unit, system.soft, work.diagonal, work.off)
    DD, m1 = D * D, rows.i.size
    for r in range(rows.both):
        i, j, at = rows.i[r] * DD, rows.j[r] * DD, pattern.distance[r] * DD
        for a in range(D):
            s = rows.alpha[r] * g[r * D + a]
            for c in range(D):
                v = s * g[r * D + c]
                diagonal[i + a * D + c] += v
                diagonal[j + a * D + c] += v
                off[at + a * D + c] -= v
    for r in range(rows.both, m1):
        i = rows.i[r] * DD
        for a in range(D):
            s = rows.alpha[r] * g[r * D + a]
            for c in range(D):
                diagonal[i + a * D + c] += s * g[r * D + c]
    for r in range(rows.movable.size):
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * DD
            for a in range(D):
                for c in range(D):
                    diagonal[i + a * D + c] += rows.alpha[m1 + r] * g2[e * D + a] * g2[e * D + c]
    pair = pattern.pair
    for n in range(np.uint64(0), pair.size, FOUR):
        e, f, at, r = pair[n], pair[n + ONE], pair[n + TWO], pair[n + TWO + ONE]
        for a in range(D):
            for c in range(D):
                off[at * DD + a * D + c] += rows.alpha[r] * g2[e * D + a] * g2[f * D + c]


@inner
def factorise(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, column: Floats) -> int:
    """A = L D Lᵀ in place, right-looking by blocks; returns the number of columns that went well.

    Inside a block the elimination is by scalars: a 2x2 or 3x3 inverse would lose the digits that
    the spread between α and M needs.
    """
    D = np.uint64(len(unit))
    DD = D * D
    u = np.uint64(0)
    for k in range(pattern.first.size - ONE):
        kk = k * DD
        for c in range(D):
            pivot = diagonal[kk + c * D + c]
            if not pivot > 0.0:
                return k
            inverse = 1.0 / pivot
            diagonal[kk + c * D + c] = inverse  # D⁻¹
            for a in range(c + ONE, D):
                for b in range(c + ONE, a + ONE):
                    diagonal[kk + a * D + b] -= (
                        diagonal[kk + a * D + c] * inverse * diagonal[kk + b * D + c]
                    )
            for a in range(c + ONE, D):
                diagonal[kk + a * D + c] *= inverse
        start = pattern.first[k]
        for n in range(pattern.first[k + ONE] - start):
            at, un = (start + n) * DD, n * DD
            for a in range(D):
                for c in range(D):
                    s = off[at + a * D + c]
                    for b in range(c):
                        s -= column[un + a * D + b] * diagonal[kk + c * D + b]
                    column[un + a * D + c] = s  # U = A_ik L_kk⁻ᵀ
                    off[at + a * D + c] = s * diagonal[kk + c * D + c]  # L_ik = U D⁻¹
            for m in range(n):
                to, um = pattern.target[u] * DD, m * DD
                u += ONE
                for a in range(D):
                    for b in range(D):
                        s = 0.0
                        for c in range(D):
                            s += off[at + a * D + c] * column[um + b * D + c]
                        off[to + a * D + b] -= s  # A_ij -= L_ik U_jkᵀ
            to = pattern.row[start + n] * DD
            for a in range(D):
                for b in range(a + ONE):
                    s = 0.0
                    for c in range(D):
                        s += off[at + a * D + c] * column[un + b * D + c]
                    diagonal[to + a * D + b] -= s
    return pattern.first.size - ONE


@compiled
def solve(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, x: Floats) -> None:
    """x = A⁻¹ x."""
    D = np.uint64(len(unit))
    DD = D * D
    n = pattern.first.size - ONE
    for k in range(n):
        for a in range(ONE, D):
            for c in range(a):
                x[k * D + a] -= diagonal[k * DD + a * D + c] * x[k * D + c]
        for at in range(pattern.first[k], pattern.first[k + ONE]):
            i = pattern.row[at] * D
            for a in range(D):
                s = 0.0
                for c in range(D):
                    s += off[at * DD + a * D + c] * x[k * D + c]
                x[i + a] -= s
    for back in range(n):
        k = n - ONE - back
        for a in range(D):
            x[k * D + a] *= diagonal[k * DD + a * D + a]
        for at in range(pattern.first[k], pattern.first[k + ONE]):
            i = pattern.row[at] * D
            for c in range(D):
                s = 0.0
                for a in range(D):
                    s += off[at * DD + a * D + c] * x[i + a]
                x[k * D + c] -= s
        for up in range(ONE, D):
            c = D - ONE - up
            for a in range(c + ONE, D):
                x[k * D + c] -= diagonal[k * DD + a * D + c] * x[k * D + a]


@compiled
def linearise(unit: Unit, system: System, work: Work, q: Floats) -> bool:
    """Φ_q and the factor of A at q; returns whether A was positive definite."""
    jacobian(unit, system.rows, q, work.g, work.g2)
    copy(work.g, work.gf)
    copy(work.g2, work.g2f)
    assemble(unit, system, work)
    columns = factorise(unit, system.pattern, work.diagonal, work.off, work.column)
    return columns == system.pattern.first.size - ONE

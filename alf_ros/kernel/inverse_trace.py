"""tr(M A⁻¹) from the factor of A, in the time of another factorisation.

With s_k the singular values of α^½ Φ_q M^-½, n - tr(M A⁻¹) = Σ s_k² / (1 + s_k²): each independent
row counts one, each dependent one zero, and a row about to become dependent counts in between, at
the scale at which the multipliers of the step feel it too.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Pattern
from alf_ros.kernel.numba_ext.block import Block, block, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, compiled, inlined
from alf_ros.kernel.numba_ext.lane_numbers import anywhere
from alf_ros.kernel.numba_ext.plain_loops import each

ThreeRows = tuple[Block, Block, Block]  # of a matrix D D; in the plane the second row twice


@inlined
def _rows(unit: Unit, A: Floats, e: np.uint64) -> ThreeRows:
    """Matrix e of A (matrices D D,)."""
    D = np.uint64(len(unit))
    at = e * D
    return block(unit, A, at), block(unit, A, at + ONE), block(unit, A, at + D - ONE)


@inlined
def _put_rows(unit: Unit, A: Floats, e: np.uint64, rows: ThreeRows) -> None:
    D = np.uint64(len(unit))
    put(A, e * D, rows[0])
    put(A, e * D + ONE, rows[1])
    if D != TWO:
        put(A, e * D + TWO, rows[2])


@inlined
def _less(unit: Unit, y: Block, x: Block, B: ThreeRows) -> Block:
    """y - x B, with x and y as rows."""
    y = y - x[ZERO] * B[0]
    y = y - x[ONE] * B[1]
    if len(unit) != 2:
        y = y - x[TWO] * B[2]
    return y


@inlined
def _column(unit: Unit, A: ThreeRows, c: np.uint64) -> Block:
    return packed(unit, A[0][c], A[1][c], A[2][c])


@inlined
def _divided(unit: Unit, diagonal: Floats, kk: np.uint64, row: Block) -> Block:
    """A row times L_kk⁻¹, from its last number."""
    D = np.uint64(len(unit))
    if D == TWO:
        last = row[ONE]
        return packed(unit, row[ZERO] - last * diagonal[kk + D], last, last)
    last = row[TWO]
    middle = row[ONE] - last * diagonal[kk + TWO * D + ONE]
    first = row[ZERO] - middle * diagonal[kk + D] - last * diagonal[kk + TWO * D]
    return packed(unit, first, middle, last)


@inlined
def _inverse_column(
    unit: Unit, diagonal: Floats, kk: np.uint64, x0: float, x1: float, x2: float
) -> tuple[float, float, float]:
    """(L D Lᵀ)⁻¹ x of the pivot block, with D⁻¹ on its diagonal."""
    D = np.uint64(len(unit))
    l10 = diagonal[kk + D]
    x1 -= l10 * x0
    if D == TWO:
        x0, x1 = x0 * diagonal[kk], x1 * diagonal[kk + D + ONE]
        return x0 - l10 * x1, x1, x1
    at = kk + TWO * D
    l20, l21 = diagonal[at], diagonal[at + ONE]
    x2 = x2 - l20 * x0 - l21 * x1
    x0, x1, x2 = x0 * diagonal[kk], x1 * diagonal[kk + D + ONE], x2 * diagonal[at + TWO]
    x1 -= l21 * x2
    return x0 - l10 * x1 - l20 * x2, x1, x2


@inlined
def _inverse(unit: Unit, diagonal: Floats, kk: np.uint64) -> ThreeRows:
    """The inverse of the pivot block."""
    a = _inverse_column(unit, diagonal, kk, 1.0, 0.0, 0.0)
    b = _inverse_column(unit, diagonal, kk, 0.0, 1.0, 0.0)
    c = _inverse_column(unit, diagonal, kk, 0.0, 0.0, 1.0)
    return (
        packed(unit, a[0], b[0], c[0]),
        packed(unit, a[1], b[1], c[1]),
        packed(unit, a[2], b[2], c[2]),
    )


@inlined
def _weighed(
    unit: Unit, total: float, masses: Floats, e: np.uint64, Z: ThreeRows, times: float
) -> float:
    """A total and a number of times tr(M_eᵀ Z). Blocks of M are multiples of the unit matrix, in
    the plane plus such of a quarter turn; most are zero."""
    D = np.uint64(len(unit))
    m, w = times * masses[e * D * D], times * masses[e * D * D + ONE]
    if anywhere((m != 0.0) | (w != 0.0)):
        total += m * Z[0][ZERO]
        if D == TWO:
            total += w * Z[0][ONE]
            total -= w * Z[1][ZERO]
        total += m * Z[1][ONE]
        if D != TWO:
            total += m * Z[2][TWO]
    return total


@compiled
def mass_trace(
    unit: Unit,
    pattern: Pattern,
    diagonal: Floats,
    off: Floats,
    column: Floats,
    Z: Floats,
    Zo: Floats,
) -> float:
    """tr(M A⁻¹) = n - Σ s_k² / (1 + s_k²).

    It needs A⁻¹ only where M is, which is within the pattern of the factor: selected inversion
    (Takahashi, Fagan & Chen 1973), in the time of a factorisation. From the last column:
    Z_ik = -Σ_j Z_ij B_jk,  Z_kk = A_kk⁻¹ - Σ_j B_jkᵀ Z_jk, with B_jk = L_jk L_kk⁻¹.
    """
    D = np.uint64(len(unit))
    n = pattern.first.size - ONE
    update = pattern.target.size
    trace = 0.0
    for back in each(0, n):
        k = n - ONE - back
        kk, start = k * D * D, np.uint64(pattern.first[k])
        count = pattern.first[k + ONE] - start
        for e in each(0, count * D):
            put(column, e, _divided(unit, diagonal, kk, block(unit, off, start * D + e)))
        update -= count * (count - ONE) // TWO
        at = update
        for e in each(0, count):
            nothing = packed(unit, 0.0, 0.0, 0.0)
            z0, z1, z2 = nothing, nothing, nothing
            B = _rows(unit, column, e)
            for f in each(0, e):
                to = np.uint64(pattern.target[at])
                at += ONE
                low, Bf = _rows(unit, Zo, to), _rows(unit, column, f)
                z0, z1 = _less(unit, z0, low[0], Bf), _less(unit, z1, low[1], Bf)
                y = _rows(unit, Zo, start + f)
                y0 = _less(unit, y[0], _column(unit, low, ZERO), B)
                y1 = _less(unit, y[1], _column(unit, low, ONE), B)
                y2 = y1
                if D != TWO:
                    z2 = _less(unit, z2, low[2], Bf)
                    y2 = _less(unit, y[2], _column(unit, low, TWO), B)
                _put_rows(unit, Zo, start + f, (y0, y1, y2))
            own = _rows(unit, Z, np.uint64(pattern.row[start + e]))
            z0, z1 = _less(unit, z0, own[0], B), _less(unit, z1, own[1], B)
            if D != TWO:
                z2 = _less(unit, z2, own[2], B)
            _put_rows(unit, Zo, start + e, (z0, z1, z2))
        a0, a1, a2 = _inverse(unit, diagonal, kk)
        for e in each(0, count):
            B, low = _rows(unit, column, e), _rows(unit, Zo, start + e)
            a0 = _less(unit, a0, _column(unit, B, ZERO), low)
            a1 = _less(unit, a1, _column(unit, B, ONE), low)
            if D != TWO:
                a2 = _less(unit, a2, _column(unit, B, TWO), low)
        own = a0, a1, a2
        _put_rows(unit, Z, k, own)
        trace = _weighed(unit, trace, pattern.mass_diagonal, k, own, 1.0)
        for e in each(start, start + count):
            trace = _weighed(unit, trace, pattern.mass_off, e, _rows(unit, Zo, e), 2.0)
    return trace

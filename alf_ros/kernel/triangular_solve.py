"""Solves with the factor L D Lᵀ of A, column by column.

A column waits for earlier columns that update it, mostly its neighbours in the elimination order:
along a chain the one before the last, as a chain is eliminated from both ends. So the values of
two neighbouring columns are held in registers, as single numbers: a vector register takes longer.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Pattern, System, Work
from alf_ros.kernel.numba_ext.block import block, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, compiled, inlined, inner
from alf_ros.kernel.numba_ext.plain_loops import each

Three = tuple[float, float, float]
TwoColumns = tuple[Three, Three]  # the two that follow a column


@inlined
def _three(unit: Unit, x: Floats, k: np.uint64) -> Three:
    """The coordinates of block k of x, of which the last counts in space only."""
    D = np.uint64(len(unit))
    return x[k * D], x[k * D + ONE], x[k * D + D - ONE]


@inlined
def _put(unit: Unit, x: Floats, k: np.uint64, b: Three) -> None:
    put(x, k, packed(unit, b[0], b[1], b[2]))


@inlined
def _eliminated(unit: Unit, diagonal: Floats, k: np.uint64, b: Three) -> Three:
    """L_kk⁻¹ b."""
    D = np.uint64(len(unit))
    kk, b2 = k * D * D, 0.0
    b1 = b[1] - diagonal[kk + D] * b[0]
    if D != TWO:
        at = kk + TWO * D
        b2 = b[2] - diagonal[at] * b[0] - diagonal[at + ONE] * b1
    return b[0], b1, b2


@inlined
def _less(unit: Unit, off: Floats, e: np.uint64, b: Three, y: Three) -> Three:
    """y - L_e b."""
    D = np.uint64(len(unit))
    at = e * D * D
    y0, y2 = y[0] - off[at] * b[0] - off[at + ONE] * b[1], 0.0
    y1 = y[1] - off[at + D] * b[0] - off[at + D + ONE] * b[1]
    if D != TWO:
        y0 -= off[at + TWO] * b[2]
        y1 -= off[at + D + TWO] * b[2]
        at += TWO * D
        y2 = y[2] - off[at] * b[0] - off[at + ONE] * b[1] - off[at + TWO] * b[2]
    return y0, y1, y2


@inlined
def eliminate(
    unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, k: np.uint64, x: Floats
) -> None:
    """Column k of x = L⁻¹ x."""
    b = _eliminated(unit, diagonal, k, _three(unit, x, k))
    _put(unit, x, k, b)
    for e in each(pattern.first[k], pattern.first[k + ONE]):
        to = pattern.row[e]
        _put(unit, x, to, _less(unit, off, e, b, _three(unit, x, to)))


@inlined
def _lower(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, x: Floats) -> None:
    """x = L⁻¹ x, with what the next two columns begin with kept out of memory."""
    n = pattern.first.size - ONE
    if n == ZERO:
        return
    here = after = _three(unit, x, ZERO)
    if n > ONE:
        after = _three(unit, x, ONE)
    for k in each(0, n):
        b = _eliminated(unit, diagonal, k, here)
        _put(unit, x, k, b)
        here = after
        if k + TWO < n:
            after = _three(unit, x, k + TWO)
        for e in each(pattern.first[k], pattern.first[k + ONE]):
            to = np.uint64(pattern.row[e])
            if to == k + TWO:
                after = _less(unit, off, e, b, after)
            elif to == k + ONE:
                here = _less(unit, off, e, b, here)
            else:
                _put(unit, x, to, _less(unit, off, e, b, _three(unit, x, to)))


@inlined
def _substituted(
    unit: Unit,
    pattern: Pattern,
    diagonal: Floats,
    off: Floats,
    k: np.uint64,
    x: Floats,
    following: TwoColumns,
) -> Three:
    """Column k of x = L⁻ᵀ D⁻¹ x; `following`: the two columns after it."""
    here, after = following
    D = np.uint64(len(unit))
    b, kk, b2 = _three(unit, x, k), k * D * D, 0.0
    b0, b1 = b[0] * diagonal[kk], b[1] * diagonal[kk + D + ONE]
    if D != TWO:
        b2 = b[2] * diagonal[kk + TWO * D + TWO]
    for e in each(pattern.first[k], pattern.first[k + ONE]):
        of, at = np.uint64(pattern.row[e]), e * D * D
        if of == k + TWO:
            s = after
        elif of == k + ONE:
            s = here
        else:
            s = _three(unit, x, of)
        # in the order in which they become known
        b0 = b0 - off[at + D] * s[1] - off[at] * s[0]
        b1 = b1 - off[at + D + ONE] * s[1] - off[at + ONE] * s[0]
        if D != TWO:
            b2 = b2 - off[at + D + TWO] * s[1] - off[at + TWO] * s[0]
            at += TWO * D
            b0 -= off[at] * s[2]
            b1 -= off[at + ONE] * s[2]
            b2 -= off[at + TWO] * s[2]
    if D != TWO:
        at = kk + TWO * D
        b0, b1 = b0 - diagonal[at] * b2, b1 - diagonal[at + ONE] * b2
    b = b0 - diagonal[kk + D] * b1, b1, b2
    _put(unit, x, k, b)
    return b


@inlined
def upper(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, x: Floats) -> None:
    """x = L⁻ᵀ D⁻¹ x."""
    n = pattern.first.size - ONE
    here = after = 0.0, 0.0, 0.0
    for back in each(0, n):
        b = _substituted(unit, pattern, diagonal, off, n - ONE - back, x, (here, after))
        here, after = b, here


@compiled
def solve(unit: Unit, pattern: Pattern, diagonal: Floats, off: Floats, x: Floats) -> None:
    """x = A⁻¹ x."""
    _lower(unit, pattern, diagonal, off, x)
    upper(unit, pattern, diagonal, off, x)


@inner
def step_by(unit: Unit, system: System, work: Work, x: Floats) -> tuple[float, float]:
    """δ = A⁻¹ δ, x += δ; returns the largest of δ and of x."""
    pattern, delta = system.pattern, work.delta
    diagonal, off = work.diagonal, work.off
    n, step, size = pattern.first.size - ONE, 0.0, 0.0
    _lower(unit, pattern, diagonal, off, delta)
    here = after = 0.0, 0.0, 0.0
    for back in each(0, n):
        k = n - ONE - back
        b = _substituted(unit, pattern, diagonal, off, k, delta, (here, after))
        here, after = b, here
        y = block(unit, x, k) + packed(unit, b[0], b[1], b[2])
        put(x, k, y)
        for a in range(len(unit)):
            step, size = max(step, abs(b[a])), max(size, abs(y[a]))
    return step, size

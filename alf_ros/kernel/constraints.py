"""Φ(q), Φ_q and their products, of distance rows and of quadratic rows."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Rows
from alf_ros.kernel.numba_ext.block import Block, add, block, dot, packed, put, subtract, times
from alf_ros.kernel.numba_ext.jit import ONE, TWO, compiled, inlined, inner
from alf_ros.kernel.numba_ext.plain_loops import each


@compiled
def jacobian(unit: Unit, rows: Rows, q: Floats, g: Floats, g2: Floats) -> None:
    """Φ_q(q), as the differences of the distance rows and the entries of the quadratic rows."""
    for r in each(0, rows.i.size):
        put(g, r, block(unit, q, rows.i[r]) - block(unit, q, rows.j[r]))
    gradients(unit, rows, q, g2)


@inner
def gradients(unit: Unit, rows: Rows, q: Floats, g2: Floats) -> None:
    """Φ_q(q) of the quadratic rows, and N."""
    for e in each(0, rows.block.size):
        put(g2, e, block(unit, rows.b, e) + _terms(unit, rows, e, q))


@inlined
def _terms(unit: Unit, rows: Rows, e: np.uint64, q: Floats) -> Block:
    """T q, of entry e."""
    g = packed(unit, 0.0, 0.0, 0.0)
    for s in each(rows.first_term[e], rows.first_term[e + ONE]):
        g = g + _times_term(unit, rows, s, block(unit, q, rows.term_block[s]))
    return g


@inlined
def _times_term(unit: Unit, rows: Rows, s: np.uint64, b: Block) -> Block:
    """T b, of term s. With T = c I the product has the bits of the whole one."""
    D = np.uint64(len(unit))
    if D != TWO and rows.full[s] == 0:
        return rows.term[s * D * D] * b
    return times(unit, rows.term, s, b)


@compiled
def jacobian_rate(unit: Unit, rows: Rows, qd: Floats, g2d: Floats) -> None:
    """Φ̇_q of the quadratic rows. For a distance row Φ̇_q is the difference of the velocities."""
    for e in each(0, rows.block.size):
        put(g2d, e, _terms(unit, rows, e, qd))


@compiled
def violation(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> None:
    """Φ(q); 0 for rows of velocities, whose slip is in `slip`."""
    for r in each(0, rows.i.size):
        d = block(unit, q, rows.i[r]) - block(unit, q, rows.j[r])
        phi[r] = 0.5 * (dot(d, d) - rows.length2[r])
    forms(unit, rows, q, phi)


@inner
def forms(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> None:
    """Φ(q) of the quadratic rows, and 0 for rows of velocities."""
    m1 = rows.i.size
    for r in each(0, rows.c.size):
        phi[m1 + r] = form(unit, rows, r, q)
    for r in range(m1 + rows.c.size, phi.size):
        phi[r] = 0.0


@inlined
def form(unit: Unit, rows: Rows, r: np.uint64, q: Floats) -> float:
    """A quadratic form, number r of rows without distances."""
    s = rows.c[r]
    for e in each(rows.first[r], rows.first[r + ONE]):
        g = block(unit, rows.b, e) + 0.5 * _terms(unit, rows, e, q)
        s += dot(block(unit, q, rows.block[e]), g)
    return s


@inlined
def value_and_rate(
    unit: Unit, rows: Rows, r: np.uint64, q: Floats, qd: Floats
) -> tuple[float, float]:
    """A quadratic form, number r of rows without distances, and its rate."""
    s, rate = rows.c[r], 0.0
    for e in each(rows.first[r], rows.first[r + ONE]):
        b, terms = block(unit, rows.b, e), _terms(unit, rows, e, q)
        s += dot(block(unit, q, rows.block[e]), b + 0.5 * terms)
        rate += dot(b + terms, block(unit, qd, rows.block[e]))
    return s, rate


@compiled
def times_jacobian(unit: Unit, rows: Rows, g: Floats, g2: Floats, v: Floats, out: Floats) -> None:
    """out = Φ_q v; with v = q̇: Φ̇, and N q̇ + B (38)."""
    for r in each(0, rows.i.size):
        d = block(unit, v, rows.i[r]) - block(unit, v, rows.j[r])
        out[r] = dot(block(unit, g, r), d)
    along_gradients(unit, rows, g2, v, out)


@inner
def along_gradients(unit: Unit, rows: Rows, g2: Floats, v: Floats, out: Floats) -> None:
    """`times_jacobian` of the rows that are no distances; with q̇ and the rates of `g2`: Φ̇_q q̇."""
    for r in each(0, rows.movable.size):
        s = 0.0
        for e in each(rows.first[r], rows.first[r + ONE]):
            s += dot(block(unit, g2, e), block(unit, v, rows.block[e]))
        out[rows.i.size + r] = s


@compiled
def add_transposed(unit: Unit, rows: Rows, g: Floats, g2: Floats, y: Floats, out: Floats) -> None:
    """out += Φ_qᵀ y, on fixed blocks too."""
    m1 = rows.i.size
    for r in each(0, m1):
        s = y[r] * block(unit, g, r)
        add(out, rows.i[r], s)
        subtract(out, rows.j[r], s)
    for r in each(0, rows.movable.size):
        for e in each(rows.first[r], rows.first[r + ONE]):
            add(out, rows.block[e], y[m1 + r] * block(unit, g2, e))


@compiled
def convective(unit: Unit, rows: Rows, g2d: Floats, qd: Floats, out: Floats) -> None:
    """out = Φ̇_q q̇."""
    for r in each(0, rows.i.size):
        d = block(unit, qd, rows.i[r]) - block(unit, qd, rows.j[r])
        out[r] = dot(d, d)
    along_gradients(unit, rows, g2d, qd, out)

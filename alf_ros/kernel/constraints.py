"""Φ(q), Φ_q, and their products: rows that are distances, and rows that are quadratic forms."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import ONE, Rows
from alf_ros.kernel.jit import compiled, inner


@compiled
def jacobian(unit: Unit, rows: Rows, q: Floats, g: Floats, g2: Floats) -> None:
    """Φ_q(q), as the differences of the distance rows and the entries of the quadratic rows."""
    D = np.uint64(len(unit))
    for r in range(rows.i.size):
        i, j = rows.i[r] * D, rows.j[r] * D
        for a in range(D):
            g[r * D + a] = q[i + a] - q[j + a]
    gradients(unit, rows, q, g2)


@inner
def gradients(unit: Unit, rows: Rows, q: Floats, g2: Floats) -> None:
    """Φ_q(q) of the quadratic rows, and N."""
    D = np.uint64(len(unit))
    for e in range(rows.block.size):
        for a in range(D):
            g2[e * D + a] = rows.b[e * D + a]
        _add_terms(D, rows, e, q, g2)


@inner
def _add_terms(D: np.uint64, rows: Rows, e: np.uint64, q: Floats, g2: Floats) -> None:
    for s in range(rows.first_term[e], rows.first_term[e + ONE]):
        j = rows.term_block[s] * D
        for a in range(D):
            for c in range(D):
                g2[e * D + a] += rows.term[(s * D + a) * D + c] * q[j + c]


@compiled
def jacobian_rate(unit: Unit, rows: Rows, qd: Floats, g2d: Floats) -> None:
    """Φ̇_q of the quadratic rows; that of a distance row is the difference of the velocities."""
    D = np.uint64(len(unit))
    for e in range(rows.block.size):
        for a in range(D):
            g2d[e * D + a] = 0.0
        _add_terms(D, rows, e, qd, g2d)


@compiled
def violation(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> None:
    """Φ(q); 0 for rows that bind velocities only."""
    D = np.uint64(len(unit))
    m1 = rows.i.size
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        s = -rows.length2[r]
        for a in range(D):
            s += (q[i + a] - q[j + a]) * (q[i + a] - q[j + a])
        phi[r] = 0.5 * s
    forms(unit, rows, q, phi)


@inner
def forms(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> None:
    """Φ(q) of the quadratic rows, and 0 for those that bind velocities only."""
    D = np.uint64(len(unit))
    m1 = rows.i.size
    for r in range(rows.c.size):
        s = rows.c[r]
        for e in range(rows.first[r], rows.first[r + ONE]):
            i = rows.block[e] * D
            for a in range(D):
                s += rows.b[e * D + a] * q[i + a]
            for n in range(rows.first_term[e], rows.first_term[e + ONE]):
                j = rows.term_block[n] * D
                for a in range(D):
                    for c in range(D):
                        s += 0.5 * q[i + a] * rows.term[(n * D + a) * D + c] * q[j + c]
        phi[m1 + r] = s
    for r in range(m1 + rows.c.size, phi.size):
        phi[r] = 0.0


@compiled
def times_jacobian(unit: Unit, rows: Rows, g: Floats, g2: Floats, v: Floats, out: Floats) -> None:
    """out = Φ_q v; of v = q̇ it is Φ̇, and N q̇ + B (38)."""
    D = np.uint64(len(unit))
    m1 = rows.i.size
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        s = 0.0
        for a in range(D):
            s += g[r * D + a] * (v[i + a] - v[j + a])
        out[r] = s
    along_gradients(unit, rows, g2, v, out)


@inner
def along_gradients(unit: Unit, rows: Rows, g2: Floats, v: Floats, out: Floats) -> None:
    """The same of the rows that are no distances; of q̇ and the rates of `g2` it is Φ̇_q q̇."""
    D = np.uint64(len(unit))
    m1 = rows.i.size
    for r in range(rows.movable.size):
        s = 0.0
        for e in range(rows.first[r], rows.first[r + ONE]):
            i = rows.block[e] * D
            for a in range(D):
                s += g2[e * D + a] * v[i + a]
        out[m1 + r] = s


@compiled
def add_transposed(unit: Unit, rows: Rows, g: Floats, g2: Floats, y: Floats, out: Floats) -> None:
    """out += Φ_qᵀ y, on fixed blocks too."""
    D = np.uint64(len(unit))
    m1 = rows.i.size
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        for a in range(D):
            s = y[r] * g[r * D + a]
            out[i + a] += s
            out[j + a] -= s
    for r in range(rows.movable.size):
        for e in range(rows.first[r], rows.first[r + ONE]):
            i = rows.block[e] * D
            for a in range(D):
                out[i + a] += y[m1 + r] * g2[e * D + a]


@compiled
def convective(unit: Unit, rows: Rows, g2d: Floats, qd: Floats, out: Floats) -> None:
    """out = Φ̇_q q̇."""
    D = np.uint64(len(unit))
    for r in range(rows.i.size):
        i, j = rows.i[r] * D, rows.j[r] * D
        s = 0.0
        for a in range(D):
            s += (qd[i + a] - qd[j + a]) * (qd[i + a] - qd[j + a])
        out[r] = s
    along_gradients(unit, rows, g2d, qd, out)

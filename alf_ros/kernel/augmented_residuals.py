"""Residuals of the augmented solve (26), (33), each in one pass over blocks and rows.

`begin_velocities` and `begin_accelerations` begin a solve, `residuals` gives the right-hand side
of a further round, `update_rows` the residual after a round.

`work` holds two Φ_q: one of the factor (`gf`, `g2f`), which α multiplies, and one of the position
(`g`, `g2`): see `augmented_solve.augmented`.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import along_gradients, gradients
from alf_ros.kernel.data import Rows, System, Work
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.mass import add_skew_times
from alf_ros.kernel.numba_ext.block import add, block, dot, put, subtract
from alf_ros.kernel.numba_ext.jit import inlined, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy_first
from alf_ros.kernel.prescribed import bias_of_forms


@inner
def residuals(unit: Unit, system: System, work: Work, f: Floats, x: Floats) -> None:
    """δ = f - M̂ x + Φ_qᵀ (α r2 - y) on movable blocks (26), (33); Φ_q as `augmented` says."""
    rows, pattern, mass = system.rows, system.pattern, system.mass
    delta, g, gf, y, r2 = work.delta, work.g, work.gf, work.y, work.r2
    for i in each(0, mass.diagonal.size):
        put(delta, i, block(unit, f, i) - mass.diagonal[i] * block(unit, x, i))
    for r in each(0, rows.both):
        i, j, k = rows.i[r], rows.j[r], pattern.bar[r]
        v = (rows.alpha[r] * r2[r]) * block(unit, gf, r) - y[r] * block(unit, g, r)
        add(delta, i, v - k * block(unit, x, j))
        subtract(delta, j, v + k * block(unit, x, i))
    for r in each(rows.both, rows.i.size):
        v = (rows.alpha[r] * r2[r]) * block(unit, gf, r) - y[r] * block(unit, g, r)
        add(delta, rows.i[r], v)
    _add_others(unit, system, work, x)  # right-hand side of (26), (33)


@inner
def _add_others(unit: Unit, system: System, work: Work, x: Floats) -> None:
    """δ += Φ_qᵀ (α r2 - y) - M̂ x of all rows but distance rows, and of all pairs of M̂ that no
    distance row binds."""
    rows, mass, apart = system.rows, system.mass, system.pattern.apart
    delta, y, r2, g2, g2f, m1 = work.delta, work.y, work.r2, work.g2, work.g2f, rows.i.size
    for n in each(0, apart.size):
        i, j, k = mass.i[apart[n]], mass.j[apart[n]], mass.k[apart[n]]
        subtract(delta, i, k * block(unit, x, j))
        subtract(delta, j, k * block(unit, x, i))
    if mass.skew.size > 0:
        add_skew_times(unit, mass, -1.0, x, delta)
    if system.soft.weight.size > 0:
        add_soft_times(unit, system.soft, -1.0, x, delta)
    for r in each(0, rows.movable.size):
        s, z = rows.alpha[m1 + r] * r2[m1 + r], y[m1 + r]
        for e in each(rows.first[r], rows.movable[r]):
            add(delta, rows.block[e], s * block(unit, g2f, e) - z * block(unit, g2, e))


@inner
def update_rows(unit: Unit, rows: Rows, work: Work) -> float:
    """y += α (Φ_q δ - r2), r2 -= Φ_q δ; returns the largest of r2, rows scaled to lengths."""
    m1, gap = rows.i.size, 0.0
    delta, g, gf, y, r2 = work.delta, work.g, work.gf, work.y, work.r2
    for r in each(0, m1):
        v = block(unit, delta, rows.i[r])
        if r < rows.both:
            v = v - block(unit, delta, rows.j[r])
        y[r] += rows.alpha[r] * (dot(block(unit, gf, r), v) - r2[r])
        r2[r] -= dot(block(unit, g, r), v)
        gap = max(gap, abs(rows.scale[r] * r2[r]))
    for r in each(0, rows.movable.size):
        sf, s = -r2[m1 + r], r2[m1 + r]
        for e in each(rows.first[r], rows.movable[r]):
            v = block(unit, delta, rows.block[e])
            sf += dot(block(unit, work.g2f, e), v)
            s -= dot(block(unit, work.g2, e), v)
        y[m1 + r] += rows.alpha[m1 + r] * sf
        r2[m1 + r] = s
        gap = max(gap, abs(rows.scale[m1 + r] * s))
    return gap


@inner
def widest(rows: Rows, phi: Floats) -> float:
    """How far the widest row of Φ is open, m."""
    gap = 0.0
    for r in range(phi.size):
        gap = max(gap, abs(phi[r]) * rows.scale[r])
    return gap


@inner
def begin_velocities(unit: Unit, system: System, work: Work) -> None:
    """Φ_q, r2 = -Φ_q q̇, y = 0, and δ = p - M̂ q̇ + Φ_qᵀ α r2 with the Φ_q of the factor (33)."""
    rows, pattern, mass, m1 = system.rows, system.pattern, system.mass, system.rows.i.size
    qd, delta, gf = work.qd, work.delta, work.gf
    for i in each(0, mass.diagonal.size):
        put(delta, i, block(unit, work.p, i) - mass.diagonal[i] * block(unit, qd, i))
    for r in each(0, rows.both):
        i, j, k = rows.i[r], rows.j[r], pattern.bar[r]
        v = (rows.alpha[r] * _begin_row(unit, work, r, i, j)) * block(unit, gf, r)
        add(delta, i, v - k * block(unit, qd, j))
        subtract(delta, j, v + k * block(unit, qd, i))
    for r in each(rows.both, m1):
        i = rows.i[r]
        s = rows.alpha[r] * _begin_row(unit, work, r, i, rows.j[r])
        add(delta, i, s * block(unit, gf, r))
    if rows.movable.size > 0:
        gradients(unit, rows, work.q, work.g2)
        along_gradients(unit, rows, work.g2, qd, work.r2)
        for r in range(m1, work.r2.size):
            work.r2[r], work.y[r] = -work.r2[r], 0.0
    _add_others(unit, system, work, qd)  # right-hand side of (33)


@inlined
def _begin_row(unit: Unit, work: Work, r: np.uint64, i: np.uint64, j: np.uint64) -> float:
    """Φ_q, r2 = -Φ_q q̇ and y = 0 of distance row r, of blocks i and j; returns r2."""
    d = block(unit, work.q, i) - block(unit, work.q, j)
    s = -dot(d, block(unit, work.qd, i) - block(unit, work.qd, j))
    put(work.g, r, d)
    work.r2[r], work.y[r] = s, 0.0
    return s


@inner
def begin_accelerations(unit: Unit, system: System, work: Work, f: Floats) -> None:
    """r2 = -Φ̇_q q̇ - Φ_q,s s̈, y = 0, and δ = f + Φ_qᵀ α r2 with the Φ_q of the factor (26)."""
    rows, qd, delta, gf, m1 = system.rows, work.qd, work.delta, work.gf, system.rows.i.size
    copy_first(f, delta, work.p.size)
    for r in each(0, m1):
        i, j = rows.i[r], rows.j[r]
        d = block(unit, qd, i) - block(unit, qd, j)
        s = -dot(d, d)
        work.r2[r], work.y[r] = s, 0.0
        v = (rows.alpha[r] * s) * block(unit, gf, r)
        add(delta, i, v)
        if r < rows.both:
            subtract(delta, j, v)
    if rows.movable.size == 0:
        return
    bias_of_forms(unit, system, work, work.r2)
    for r in each(0, rows.movable.size):
        s = -work.r2[m1 + r]
        work.r2[m1 + r], work.y[m1 + r], s = s, 0.0, rows.alpha[m1 + r] * s
        for e in each(rows.first[r], rows.movable[r]):
            add(delta, rows.block[e], s * block(unit, work.g2f, e))  # right-hand side of (26)

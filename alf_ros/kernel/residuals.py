"""Residuals of the augmented solve, each in one pass over points and rows: δ before a round, where
a solve begins, and what a round leaves.

Φ_q stands twice in `work`: that of the factor (`gf`, `g2f`), which α multiplies, and that of the
place (`g`, `g2`): see `iteration.augmented`.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import along_gradients, gradients
from alf_ros.kernel.data import Rows, System, Work
from alf_ros.kernel.jit import inlined, inner
from alf_ros.kernel.mass import add_skew_times
from alf_ros.kernel.prescribed import bias_of_forms
from alf_ros.kernel.soft import add_soft_times


@inner
def residuals(unit: Unit, system: System, work: Work, f: Floats, x: Floats) -> None:
    """δ = f - M̂ x + Φ_qᵀ (α r2 - y) on movable blocks, Φ_q as `augmented` says."""
    D, rows, pattern, mass = np.uint64(len(unit)), system.rows, system.pattern, system.mass
    delta, g, gf, y, r2 = work.delta, work.g, work.gf, work.y, work.r2
    for i in range(mass.diagonal.size):
        k = mass.diagonal[i]
        for a in range(i * D, i * D + D):
            delta[a] = f[a] - k * x[a]
    for r in range(rows.both):
        i, j, s, z, k = rows.i[r] * D, rows.j[r] * D, rows.alpha[r] * r2[r], y[r], pattern.bar[r]
        for a in range(D):
            v = s * gf[r * D + a] - z * g[r * D + a]
            delta[i + a] += v - k * x[j + a]
            delta[j + a] -= v + k * x[i + a]
    for r in range(rows.both, rows.i.size):
        i, s, z = rows.i[r] * D, rows.alpha[r] * r2[r], y[r]
        for a in range(D):
            delta[i + a] += s * gf[r * D + a] - z * g[r * D + a]
    _add_others(unit, system, work, x)


@inner
def _add_others(unit: Unit, system: System, work: Work, x: Floats) -> None:
    """Of the same what belongs to no distance row: δ += Φ_qᵀ (α r2 - y) - M̂ x."""
    D, rows, mass, apart = np.uint64(len(unit)), system.rows, system.mass, system.pattern.apart
    delta, y, r2, g2, g2f, m1 = work.delta, work.y, work.r2, work.g2, work.g2f, rows.i.size
    for n in range(apart.size):
        i, j, k = mass.i[apart[n]] * D, mass.j[apart[n]] * D, mass.k[apart[n]]
        for a in range(D):
            delta[i + a] -= k * x[j + a]
            delta[j + a] -= k * x[i + a]
    if mass.skew.size > 0:
        add_skew_times(unit, mass, -1.0, x, delta)
    if system.soft.weight.size > 0:
        add_soft_times(unit, system.soft, -1.0, x, delta)
    for r in range(rows.movable.size):
        s, z = rows.alpha[m1 + r] * r2[m1 + r], y[m1 + r]
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * D
            for a in range(D):
                delta[i + a] += s * g2f[e * D + a] - z * g2[e * D + a]


@inner
def update_rows(unit: Unit, rows: Rows, work: Work) -> float:
    """y += α (Φ_q δ - r2), r2 -= Φ_q δ; returns the largest of r2, rows scaled to lengths."""
    D, m1, widest = np.uint64(len(unit)), rows.i.size, 0.0
    delta, g, gf, y, r2 = work.delta, work.g, work.gf, work.y, work.r2
    g2, g2f = work.g2, work.g2f
    for r in range(rows.both):
        i, j, sf, s = rows.i[r] * D, rows.j[r] * D, -r2[r], r2[r]
        for a in range(D):
            v = delta[i + a] - delta[j + a]
            sf += gf[r * D + a] * v
            s -= g[r * D + a] * v
        y[r] += rows.alpha[r] * sf
        r2[r] = s
        widest = max(widest, abs(rows.scale[r] * s))
    for r in range(rows.both, m1):
        i, sf, s = rows.i[r] * D, -r2[r], r2[r]
        for a in range(D):
            sf += gf[r * D + a] * delta[i + a]
            s -= g[r * D + a] * delta[i + a]
        y[r] += rows.alpha[r] * sf
        r2[r] = s
        widest = max(widest, abs(rows.scale[r] * s))
    for r in range(rows.movable.size):
        sf, s = -r2[m1 + r], r2[m1 + r]
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * D
            for a in range(D):
                sf += g2f[e * D + a] * delta[i + a]
                s -= g2[e * D + a] * delta[i + a]
        y[m1 + r] += rows.alpha[m1 + r] * sf
        r2[m1 + r] = s
        widest = max(widest, abs(rows.scale[m1 + r] * s))
    return widest


@inner
def begin_velocities(unit: Unit, system: System, work: Work) -> None:
    """Φ_q, r2 = -Φ_q q̇, y = 0, and δ = p - M̂ q̇ + Φ_qᵀ α r2 with the Φ_q of the factor."""
    D, rows, pattern, mass = np.uint64(len(unit)), system.rows, system.pattern, system.mass
    q, qd, delta, gf, p, m1 = work.q, work.qd, work.delta, work.gf, work.p, rows.i.size
    for i in range(mass.diagonal.size):
        k = mass.diagonal[i]
        for a in range(i * D, i * D + D):
            delta[a] = p[a] - k * qd[a]
    for r in range(rows.both):
        i, j, k = rows.i[r] * D, rows.j[r] * D, pattern.bar[r]
        s = rows.alpha[r] * _begin_row(unit, work, r, i, j)
        for a in range(D):
            v = s * gf[r * D + a]
            delta[i + a] += v - k * qd[j + a]
            delta[j + a] -= v + k * qd[i + a]
    for r in range(rows.both, m1):
        i = rows.i[r] * D
        s = rows.alpha[r] * _begin_row(unit, work, r, i, rows.j[r] * D)
        for a in range(D):
            delta[i + a] += s * gf[r * D + a]
    if rows.movable.size > 0:
        gradients(unit, rows, q, work.g2)
        along_gradients(unit, rows, work.g2, qd, work.r2)
        for r in range(m1, work.r2.size):
            work.r2[r], work.y[r] = -work.r2[r], 0.0
    _add_others(unit, system, work, qd)


@inlined
def _begin_row(unit: Unit, work: Work, r: np.uint64, i: np.uint64, j: np.uint64) -> float:
    """Of distance row r, whose blocks begin at i and j: Φ_q, r2 = -Φ_q q̇ and y = 0; returns r2."""
    D, s = np.uint64(len(unit)), 0.0
    for a in range(D):
        d = work.q[i + a] - work.q[j + a]
        work.g[r * D + a] = d
        s -= d * (work.qd[i + a] - work.qd[j + a])
    work.r2[r], work.y[r] = s, 0.0
    return s


@inner
def begin_accelerations(unit: Unit, system: System, work: Work, f: Floats) -> None:
    """r2 = -Φ̇_q q̇ - Φ_q,s s̈, y = 0, and δ = f + Φ_qᵀ α r2 with the Φ_q of the factor."""
    D, rows, qd, delta, gf = np.uint64(len(unit)), system.rows, work.qd, work.delta, work.gf
    m1 = rows.i.size
    for i in range(work.p.size):
        delta[i] = f[i]
    for r in range(m1):
        i, j, s = rows.i[r] * D, rows.j[r] * D, 0.0
        for a in range(D):
            s -= (qd[i + a] - qd[j + a]) * (qd[i + a] - qd[j + a])
        work.r2[r], work.y[r], s = s, 0.0, rows.alpha[r] * s
        for a in range(D):
            delta[i + a] += s * gf[r * D + a]
        if r < rows.both:
            for a in range(D):
                delta[j + a] -= s * gf[r * D + a]
    if rows.movable.size == 0:
        return
    bias_of_forms(unit, system, work, work.r2)
    for r in range(rows.movable.size):
        s = -work.r2[m1 + r]
        work.r2[m1 + r], work.y[m1 + r], s = s, 0.0, rows.alpha[m1 + r] * s
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * D
            for a in range(D):
                delta[i + a] += s * work.g2f[e * D + a]

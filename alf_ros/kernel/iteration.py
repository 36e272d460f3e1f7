"""The augmented solve (26), (33): velocities from momenta, accelerations from forces."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import constraint_rate, convective, jacobian_rate
from alf_ros.kernel.data import SOLVED, Forces, Rows, System, Work
from alf_ros.kernel.factor import solve
from alf_ros.kernel.forces import applied_forces
from alf_ros.kernel.jit import compiled, inner
from alf_ros.kernel.mass import add_mass_times, subtract_mass_times
from alf_ros.kernel.vectors import zero


@compiled
def augmented(
    unit: Unit,
    system: System,
    work: Work,
    f: Floats,
    x: Floats,
    iterations: int,
    tolerance: float,
    multipliers: bool,
) -> tuple[int, float]:
    """Iterate to M x + Φ_qᵀ y = f, Φ_q x = -c with the one factor; returns how often, how slowly.

    y and r2 stand in `work`: on entry r2 = -c - Φ_q x, and y is a first guess. (26), (33) in
    residual form: A δ = f - M x - Φ_qᵀ y + Φ_qᵀ α r2,  x += δ,  y += α (Φ_q δ - r2); so α costs no
    precision. Where α stands, Φ_q is that of the factor, and elsewhere that of the place: they may
    differ a little, and with the factor's in both they would converge to the wrong place, with the
    place's in both they would not converge. It ends when the next δ, foreseen from the ratio of
    the last two, would not matter beside x, or beside what f would do to the masses alone. A ratio
    that does is 1 / (1 + s²) of the mode of a singular position; the largest one is returned.
    Without `multipliers` the last step of y is left out.
    """
    D = np.uint64(len(unit))
    rows, delta = system.rows, work.delta
    n = system.mass.diagonal.size * D
    before, slowest = 0.0, 0.0
    alone = 0.0
    for a in range(n):
        alone = max(alone, abs(f[a]))
    alone /= system.heaviest
    for count in range(1, iterations + 1):
        subtract_mass_times(unit, system.mass, f, x, delta)
        _add_rows(D, rows, work)
        solve(unit, system.pattern, work.diagonal, work.off, delta)
        step, size = 0.0, alone
        for a in range(n):
            x[a] += delta[a]
            step = max(step, abs(delta[a]))
            size = max(size, abs(x[a]))
        ratio = 1.0
        if count > 1:
            ratio = min(1.0, step / before)
            if step > 1e-6 * size:  # what is left of the other modes is less
                slowest = max(slowest, ratio)
        if step * ratio <= tolerance * size:
            if multipliers:
                _update_rows(D, rows, work)
            return count, slowest
        _update_rows(D, rows, work)
        before = step
    return iterations, slowest


@inner
def _add_rows(D: np.uint64, rows: Rows, work: Work) -> None:
    """δ += Φ_qᵀ (α r2 - y) on movable blocks, Φ_q as `augmented` says."""
    delta, g, gf, y, r2, g2, g2f = (
        work.delta,
        work.g,
        work.gf,
        work.y,
        work.r2,
        work.g2,
        work.g2f,
    )
    m1 = rows.i.size
    for r in range(rows.both):
        i, j, s, z = rows.i[r] * D, rows.j[r] * D, rows.alpha[r] * r2[r], y[r]
        for a in range(D):
            v = s * gf[r * D + a] - z * g[r * D + a]
            delta[i + a] += v
            delta[j + a] -= v
    for r in range(rows.both, m1):
        i, s, z = rows.i[r] * D, rows.alpha[r] * r2[r], y[r]
        for a in range(D):
            delta[i + a] += s * gf[r * D + a] - z * g[r * D + a]
    for r in range(rows.movable.size):
        s, z = rows.alpha[m1 + r] * r2[m1 + r], y[m1 + r]
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * D
            for a in range(D):
                delta[i + a] += s * g2f[e * D + a] - z * g2[e * D + a]


@inner
def _update_rows(D: np.uint64, rows: Rows, work: Work) -> None:
    """y += α (Φ_q δ - r2), r2 -= Φ_q δ."""
    delta, g, gf, y, r2, g2, g2f = (
        work.delta,
        work.g,
        work.gf,
        work.y,
        work.r2,
        work.g2,
        work.g2f,
    )
    m1 = rows.i.size
    for r in range(rows.both):
        i, j, sf, s = rows.i[r] * D, rows.j[r] * D, -r2[r], 0.0
        for a in range(D):
            v = delta[i + a] - delta[j + a]
            sf += gf[r * D + a] * v
            s += g[r * D + a] * v
        y[r] += rows.alpha[r] * sf
        r2[r] -= s
    for r in range(rows.both, m1):
        i, sf, s = rows.i[r] * D, -r2[r], 0.0
        for a in range(D):
            sf += gf[r * D + a] * delta[i + a]
            s += g[r * D + a] * delta[i + a]
        y[r] += rows.alpha[r] * sf
        r2[r] -= s
    for r in range(rows.movable.size):
        sf, s = -r2[m1 + r], 0.0
        for e in range(rows.first[r], rows.movable[r]):
            i = rows.block[e] * D
            for a in range(D):
                sf += g2f[e * D + a] * delta[i + a]
                s += g2[e * D + a] * delta[i + a]
        y[m1 + r] += rows.alpha[m1 + r] * sf
        r2[m1 + r] -= s


@inner
def velocities(unit: Unit, system: System, work: Work, iterations: int) -> tuple[int, float]:
    """q̇ from the momenta p' with the factor in `work` (33); q̇ there is a guess."""
    constraint_rate(unit, system.rows, work.g, work.g2, work.qd, work.r2)
    for r in range(work.r2.size):
        work.r2[r] = -work.r2[r]
        work.y[r] = 0.0
    return augmented(unit, system, work, work.p, work.qd, iterations, SOLVED, False)


@compiled
def accelerate(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    multipliers: bool,
) -> tuple[int, float]:
    """q̈ and λ (in y) at the stage in `work` from its factor, from a cold start (24)-(27)."""
    applied_forces(forces, t, work.q, work.qd, work.near, work.Q)
    unforced(unit, system, work)
    zero(work.qdd)
    return augmented(unit, system, work, work.Q, work.qdd, iterations, SOLVED, multipliers)


@inner
def unforced(unit: Unit, system: System, work: Work) -> None:
    """r2 = -Φ̇_q q̇ and y = 0: where a solve for accelerations begins."""
    jacobian_rate(unit, system.rows, work.qd, work.g2d)
    convective(unit, system.rows, work.g2d, work.qd, work.r2)
    for r in range(work.r2.size):
        work.r2[r] = -work.r2[r]
        work.y[r] = 0.0


@inner
def momentum_rate(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
) -> tuple[int, float]:
    """ṗ' = M q̈ at the stage in `work`, into p; returns iterations and their slowest ratio.

    ṗ' = Q - Φ_qᵀ λ + Φ̇_qᵀ σ' (35) with λ fed forward, and Q - Φ_qᵀ λ = M q̈. What σ' is left is
    error of the integration over the distance to the singular position: the gauge is reset at
    every stage, and the last term is dropped.
    """
    count, slowest = accelerate(unit, system, forces, work, t, iterations, False)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.qdd, work.p)
    return count, slowest

"""The canonical form with Lagrange multipliers, (11)-(12).

State y = (q, p). The constraints stand at velocity level, Φ drifts with the error of a step only:

    [M Φ_qᵀ; Φ_q 0] [q̇; σ] = [p; 0]                                (12)
    ṗ = Q + Φ̇_qᵀ σ
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Indices, Integers, Unit
from alf_ros.formulations import baumgarte, saddle
from alf_ros.formulations.runge_kutta import runge_kutta
from alf_ros.formulations.storage import SINGULAR, Storage, compiled, inner
from alf_ros.kernel import (
    OK,
    Forces,
    System,
    Work,
    add_mass_times,
    add_transposed,
    applied_forces,
    jacobian,
    jacobian_rate,
    zero,
)
from alf_ros.model import Model

prepare = baumgarte.prepare


def start(model: Model, storage: Storage, q: Floats, qd: Floats) -> Floats:
    """Return y at q, q̇ (all blocks D), σ = 0."""
    p = np.zeros(model.n)
    add_mass_times(model.unit, model.system.mass, 1.0, qd, p)
    return np.concatenate([q[: model.n], p])


@inner
def rates(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    storage: Storage,
    t: float,
    stage: np.uint64,
    iterations: int,
) -> tuple[int, int]:
    """ẏ = (q̇, ṗ); returns (result, 1)."""
    n = np.uint64(work.p.size)
    rows, y, sigma = system.rows, storage.y, storage.sigma
    at = stage * n * np.uint64(2)
    for i in range(n):
        work.q[i] = y[i]
    if not saddle.factorise(unit, system, work, storage):
        return SINGULAR, 0
    for i in range(n):
        work.p[i] = y[n + i]
    zero(storage.c)
    saddle.solve(system, storage, work.p, storage.c, work.qd, sigma)  # eq. (12)
    # Φ̇_q: that of a distance row is the difference of the velocities
    jacobian(unit, rows, work.qd, storage.gd, storage.g2d)
    jacobian_rate(unit, rows, work.qd, storage.g2d)
    applied_forces(forces, t, work.q, work.qd, work.Q)
    add_transposed(unit, rows, storage.gd, storage.g2d, sigma, work.Q)  # ṗ
    for i in range(n):
        storage.k[at + i], storage.k[at + n + i] = work.qd[i], work.Q[i]
    return OK, 1


@compiled
def advance(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    storage: Storage,
    a: Floats,
    b: Floats,
    c: Floats,
    axes: Indices,
    y: Floats,
    q: Floats,
    qd: Floats,
    turns: Integers,
    t0: float,
    first: int,
    steps: int,
    h: float,
    iterations: int,
    size: float,
) -> tuple[int, int, int]:
    """Take steps, as `runge_kutta` says."""
    return runge_kutta(
        rates, unit, system, forces, work, storage,
        a, b, c, axes, y, q, qd, turns, t0, first, steps, h, iterations, size,
    )

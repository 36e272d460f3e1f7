"""The canonical form with Lagrange multipliers, (11)-(12).

State y = (q, p). The constraints stand at velocity level, Φ drifts with the error of a step only:

    [M Φ_qᵀ; Φ_q 0] [q̇; σ] = [p; -Φ_t]                             (12)
    ṗ = Q + Φ̇_qᵀ σ
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import applied_forces
from alf_ros.kernel.constraints import add_transposed, jacobian, jacobian_rate, times_jacobian
from alf_ros.kernel.data import Forces, Method, Phase, System, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import TWO, compiled, inner
from alf_ros.kernel.status import OK, SINGULAR
from alf_ros.model.compile import Model
from alf_ros.simulation.formulations import baumgarte, saddle_point
from alf_ros.simulation.formulations.fixed_step import runge_kutta
from alf_ros.simulation.formulations.storage import Storage

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
) -> tuple[int, int]:
    """ẏ = (q̇, ṗ); returns (result, 1)."""
    n = work.p.size
    rows, y, c, sigma = system.rows, storage.y, storage.c, storage.sigma
    at = stage * n * TWO
    for i in range(n):
        work.q[i] = y[i]
    if not saddle_point.factorise(unit, system, work, storage):
        return SINGULAR, 0
    for i in range(n):
        work.p[i] = y[n + i]
    for i in range(n):
        work.qd[i] = 0.0
    times_jacobian(unit, rows, work.g, work.g2, work.qd, c)  # Φ_t
    for r in range(c.size):
        c[r] = -c[r]
    saddle_point.solve(system, storage, work.p, c, work.qd, sigma)  # eq. (12)
    # Φ̇_q: for a distance row the difference of the velocities
    jacobian(unit, rows, work.qd, storage.gd, storage.g2d)
    jacobian_rate(unit, rows, work.qd, storage.g2d)
    applied_forces(forces.effects, t, work.q, work.qd, work.near, work.Q)
    add_transposed(unit, rows, storage.gd, storage.g2d, sigma, work.Q)  # ṗ
    for i in range(n):
        storage.k[at + i], storage.k[at + n + i] = work.qd[i], work.Q[i]
    return OK, 1


@compiled
def advance(
    unit: Unit,
    system: System,
    forces: Forces,
    method: Method,
    work: Work,
    storage: Storage,
    phase: Phase,
    y: Floats,
    t0: float,
    first: int,
    steps: int,
    h: float,
) -> tuple[int, int, int]:
    """Take steps, as `runge_kutta` says."""
    return runge_kutta(
        rates, unit, system, forces, method, work, storage, phase, y, t0, first, steps, h
    )

"""Lagrange multipliers, with the constraints stabilised after Baumgarte (4).

State y = (q, q̇):

    [M Φ_qᵀ; Φ_q 0] [q̈; λ] = [Q; -Φ̇_q q̇ - 2ΩμΦ̇ - Ω²Φ]             (4)
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import applied_forces
from alf_ros.kernel.constraints import times_jacobian, violation
from alf_ros.kernel.data import Forces, Method, Phase, System, Work
from alf_ros.kernel.numba_ext.jit import TWO, compiled, inner
from alf_ros.kernel.prescribed import bias
from alf_ros.kernel.status import OK, SINGULAR
from alf_ros.model.compile import Model
from alf_ros.simulation.formulations import alf1, saddle_point
from alf_ros.simulation.formulations.fixed_step import runge_kutta
from alf_ros.simulation.formulations.storage import Settings, Storage, allocate

start = alf1.start


def prepare(model: Model, settings: Settings, q: Floats) -> Storage:
    """Allocate what a run from q (all blocks D) writes."""
    return allocate(model, settings, 2 * model.n, model.n + len(model.row_names))


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
    """ẏ = (q̇, q̈); returns (result, 1)."""
    n = work.p.size
    rows, omega, mu = system.rows, storage.omega, storage.mu
    y, c, phi, phi_d = storage.y, storage.c, storage.phi, storage.phi_d
    at = stage * n * TWO
    for i in range(n):
        work.q[i], work.qd[i] = y[i], y[n + i]
    if not saddle_point.factorise(unit, system, work, storage):
        return SINGULAR, 0
    violation(unit, rows, work.q, phi)
    times_jacobian(unit, rows, work.g, work.g2, work.qd, phi_d)
    bias(unit, system, work, c)
    for r in range(c.size):
        c[r] = -c[r] - 2.0 * omega * mu * phi_d[r] - omega * omega * phi[r]
    applied_forces(forces.effects, t, work.q, work.qd, work.near, work.Q)
    saddle_point.solve(system, storage, work.Q, c, work.qdd, storage.sigma)  # eq. (4)
    for i in range(n):
        storage.k[at + i], storage.k[at + n + i] = work.qd[i], work.qdd[i]
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

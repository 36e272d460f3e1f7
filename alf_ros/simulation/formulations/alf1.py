"""ALF1, the augmented Lagrangian formulation of accelerations, (24)-(27), as printed.

State y = (q, q̇). The constraints are penalised as Φ̈ + 2ΩμΦ̇ + Ω²Φ, Φ̈ = Φ_q q̈ + Φ̇_q q̇:

    A q̈_i+1 = M q̈_i - Φ_qᵀ α (Φ̇_q q̇ + 2ΩμΦ̇ + Ω²Φ),   M q̈_0 = Q     (26)

The penalty method is the first iterate alone: its error falls as 1/α. That M q̈_i is formed
multiplies rounding by α.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import applied_forces
from alf_ros.kernel.constraints import add_transposed, times_jacobian, violation
from alf_ros.kernel.data import SOLVED, Forces, Method, Phase, System, Work
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import TWO, compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import bias, prescribe
from alf_ros.kernel.status import NOT_POSITIVE, OK
from alf_ros.kernel.stopping import LEFT
from alf_ros.kernel.triangular_solve import solve
from alf_ros.model.compile import Model
from alf_ros.simulation.formulations.fixed_step import runge_kutta
from alf_ros.simulation.formulations.storage import Settings, Storage, allocate


def prepare(model: Model, settings: Settings, q: Floats) -> Storage:
    """Allocate what a run from q (all blocks D) writes."""
    return allocate(model, settings, 2 * model.n)


def start(model: Model, storage: Storage, q: Floats, qd: Floats) -> Floats:
    """Return y at q, q̇ (all blocks D)."""
    return np.concatenate([q[: model.n], qd[: model.n]])


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
    """ẏ = (q̇, q̈); returns (result, iterations)."""
    n = work.p.size
    rows, omega, mu = system.rows, storage.omega, storage.mu
    y, c, phi, phi_d = storage.y, storage.c, storage.phi, storage.phi_d
    at = stage * n * TWO
    for i in range(n):
        work.q[i], work.qd[i] = y[i], y[n + i]
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE, 0
    violation(unit, rows, work.q, phi)
    times_jacobian(unit, rows, work.g, work.g2, work.qd, phi_d)
    bias(unit, system, work, c)
    for r in range(c.size):
        c[r] = -rows.alpha[r] * (c[r] + 2.0 * omega * mu * phi_d[r] + omega * omega * phi[r])
    applied_forces(forces.effects, t, work.q, work.qd, work.near, work.Q)
    copy(work.Q, storage.f)  # M q̈_0 = Q
    for i in range(n):
        work.qdd[i] = 0.0
    count = 0
    for _ in range(np.int64(storage.iterations)):
        count += 1
        work.pulse[LEFT] -= 1
        copy(storage.f, work.delta)
        add_transposed(unit, rows, work.g, work.g2, c, work.delta)
        solve(unit, system.pattern, work.diagonal, work.off, work.delta)
        change, largest = 0.0, 0.0
        for i in range(n):
            change = max(change, abs(work.delta[i] - work.qdd[i]))
            largest = max(largest, abs(work.delta[i]))
            work.qdd[i] = work.delta[i]  # q̈_i+1, eq. (26)
        if change <= SOLVED * largest:
            break
        zero(storage.f)
        add_mass_times(unit, system.mass, 1.0, work.qdd, storage.f)
    for i in range(n):
        storage.k[at + i], storage.k[at + n + i] = work.qd[i], work.qdd[i]
    return OK, count


@compiled
def derivative(
    unit: Unit, system: System, forces: Forces, work: Work, storage: Storage, t: float
) -> int:
    """Write ẏ = (q̇, q̈) at the state in storage.y into storage.k; returns the result."""
    prescribe(system, t, work.q, work.qd, work.qdd)
    result, _count = rates(unit, system, forces, work, storage, t, np.uint64(0))
    return result


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

"""ALF2, the canonical augmented Lagrangian formulation, (32)-(35), as printed but for its signs.

State y = (q, p, s), s = ∫Φ dt. With c = Φ_t + 2ΩμΦ + Ω²s the constraints are penalised as Φ̇ + c:

    p = M q̇ + Φ_qᵀ σ                                               (32)
    A q̇_i+1 = M q̇_i - Φ_qᵀ α c,   M q̇_0 = p                        (33a), (34)
    σ_i+1 = σ_i + α (Φ_q q̇_i+1 + c),   σ_0 = 0                     (33b)
    ṗ = Q + Φ̇_qᵀ σ, with the total σ,   ṡ = Φ                       (35)

The canonical penalty method (30) is the first iterate alone.

σ is an impulse, and grows with time. At a singular position the row that loses its direction
releases its share of it, and of p: that is what `alf2` of this package removes.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import applied_forces
from alf_ros.kernel.constraints import (
    add_transposed,
    jacobian,
    jacobian_rate,
    times_jacobian,
    violation,
)
from alf_ros.kernel.data import SOLVED, Forces, Method, Phase, System, Work
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.status import NOT_POSITIVE, OK
from alf_ros.kernel.stopping import LEFT
from alf_ros.kernel.triangular_solve import solve
from alf_ros.model.compile import Model
from alf_ros.simulation.formulations.fixed_step import runge_kutta
from alf_ros.simulation.formulations.storage import Settings, Storage, allocate


def prepare(model: Model, settings: Settings, q: Floats) -> Storage:
    """Allocate what a run from q (all blocks D) writes."""
    return allocate(model, settings, 2 * model.n + len(model.row_names))


def start(model: Model, storage: Storage, q: Floats, qd: Floats) -> Floats:
    """Return y at q, q̇ (all blocks D), σ = 0 and s = 0."""
    y = np.zeros(storage.y.size)
    momenta = y[model.n : 2 * model.n]
    y[: model.n] = q[: model.n]
    add_mass_times(model.unit, model.system.mass, 1.0, qd, momenta)
    return y


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
    """ẏ = (q̇, ṗ, Φ); returns (result, iterations)."""
    n, m = work.p.size, storage.phi.size
    rows, omega, mu = system.rows, storage.omega, storage.mu
    y, c, phi, sigma = storage.y, storage.c, storage.phi, storage.sigma
    two_n = n + n
    at = stage * (two_n + m)
    zero(storage.f)
    for i in range(n):
        work.q[i], storage.f[i] = y[i], y[n + i]  # M q̇_0 = p
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE, 0
    violation(unit, rows, work.q, phi)
    for i in range(n):
        work.qd[i] = 0.0
    times_jacobian(unit, rows, work.g, work.g2, work.qd, c)  # Φ_t
    zero(work.qd)
    for r in range(m):
        c[r] += 2.0 * omega * mu * phi[r] + omega * omega * y[two_n + r]
    zero(sigma)
    count = 0
    for _ in range(np.int64(storage.iterations)):
        count += 1
        work.pulse[LEFT] -= 1
        for r in range(m):
            storage.phi_d[r] = -rows.alpha[r] * c[r]
        copy(storage.f, work.delta)
        add_transposed(unit, rows, work.g, work.g2, storage.phi_d, work.delta)
        solve(unit, system.pattern, work.diagonal, work.off, work.delta)
        change, largest = 0.0, 0.0
        for i in range(n):
            change = max(change, abs(work.delta[i] - work.qd[i]))
            largest = max(largest, abs(work.delta[i]))
            work.qd[i] = work.delta[i]  # q̇_i+1, eq. (33a)
        times_jacobian(unit, rows, work.g, work.g2, work.qd, storage.phi_d)
        for r in range(m):
            sigma[r] += rows.alpha[r] * (storage.phi_d[r] + c[r])  # eq. (33b)
        if change <= SOLVED * largest:
            break
        zero(storage.f)
        add_mass_times(unit, system.mass, 1.0, work.qd, storage.f)
    prescribe(system, t, work.q, work.qd, work.qdd)
    # Φ̇_q: for a distance row the difference of the velocities
    jacobian(unit, rows, work.qd, storage.gd, storage.g2d)
    jacobian_rate(unit, rows, work.qd, storage.g2d)
    applied_forces(forces.effects, t, work.q, work.qd, work.near, work.Q)
    add_transposed(unit, rows, storage.gd, storage.g2d, sigma, work.Q)  # ṗ, eq. (35)
    for i in range(n):
        storage.k[at + i], storage.k[at + n + i] = work.qd[i], work.Q[i]
    for r in range(m):
        storage.k[at + two_n + r] = phi[r]
    return OK, count


@compiled
def derivative(
    unit: Unit, system: System, forces: Forces, work: Work, storage: Storage, t: float
) -> int:
    """Write ẏ = (q̇, ṗ, Φ) at the state in storage.y into storage.k; returns the result."""
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

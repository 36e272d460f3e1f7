"""Reduction to independent coordinates (15).

The coordinates q are split at the start into dependent ones and independent ones z, as many as the
mechanism has freedoms. State y = (q, ż), of which the dependent q are only a guess: Φ = 0 gives
them from z in every stage.

    q̇ = R ż,   Φ_q R = 0,   R = 1 for z
    Rᵀ M R z̈ = Rᵀ (Q - M Ṙ ż)                                      (15)

It ends where the columns of Φ_q for the dependent coordinates lose rank: in a singular position,
and already where a coordinate of z turns back while the mechanism continues.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from alf_ros.arrays import Floats, Indices, Unit
from alf_ros.errors import InputError
from alf_ros.kernel.applied_forces import applied_forces
from alf_ros.kernel.constraints import jacobian, times_jacobian
from alf_ros.kernel.data import Forces, Method, Phase, System, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import zero
from alf_ros.kernel.prescribed import bias
from alf_ros.kernel.projection import opening_without_slips
from alf_ros.kernel.status import FOLDED, OK, SINGULAR
from alf_ros.model.compile import Model
from alf_ros.model.compile import allocate as workspace
from alf_ros.model.ordinary_positions import ordinary
from alf_ros.simulation.formulations import dense_lu
from alf_ros.simulation.formulations.fixed_step import runge_kutta
from alf_ros.simulation.formulations.storage import Settings, Storage, allocate

_CLOSED = 1e-15  # gap of a closed row, relative to the mechanism
_ENOUGH = 1e-10  # gap that is accepted if it does not close any further


def split(model: Model, q: Floats) -> tuple[Indices, Indices]:
    """The coordinates, dependent ones first, and the rows that determine those, at q.

    By pivoted QR, as many as rows are independent at ordinary positions near q: in a singular
    position Φ_q has not that rank, and the first step says so.
    """
    rows, work = model.system.rows, workspace(model, model.system, 1)
    jacobian(model.unit, rows, q, work.g, work.g2)
    phi_q = np.zeros((rows.alpha.size, model.n))
    for j in range(model.n):
        e = np.zeros(q.size)
        e[j] = 1.0
        times_jacobian(model.unit, rows, work.g, work.g2, e, work.r2)
        phi_q[:, j] = rows.scale * work.r2
    rank = len(model.row_names) - ordinary(model, q)[0]
    order = qr(phi_q, mode='r', pivoting=True)[1]
    kept = qr(phi_q[:, order[:rank]].T, mode='r', pivoting=True)[1][:rank]
    return order.astype(np.uint32), np.sort(kept).astype(np.uint32)


def prepare(model: Model, settings: Settings, q: Floats) -> Storage:
    """Allocate the arrays that a run from q (all blocks D) writes, and choose its independent
    coordinates.

    Raises InputError for constraints of velocities: they leave more coordinates independent than
    velocities. Raises InputError for drives too: velocities then do not depend on the independent
    ones alone.
    """
    if model.system.rows.velocity or model.mechanism.prescribed:
        raise InputError(
            'only for constraints of positions that do not depend on time',
            key='formulation',
            value='independent',
        )
    order, kept = split(model, q)
    free = order.size - kept.size
    widest = max(free, kept.size)
    return allocate(model, settings, model.n + free, widest, order, kept)


def start(model: Model, storage: Storage, q: Floats, qd: Floats) -> Floats:
    """Return y at q, q̇ (all blocks D)."""
    return np.concatenate([q[: model.n], qd[storage.order[storage.kept.size :]]])


@inner
def _factorise(unit: Unit, system: System, work: Work, storage: Storage) -> bool:
    """Φ_q of the kept rows at q in `work`, scaled, and the LU of its dependent columns."""
    n, d = storage.order.size, storage.kept.size
    rows, e = system.rows, work.delta
    jacobian(unit, rows, work.q, work.g, work.g2)
    for j in range(n):
        zero(e)
        e[storage.order[j]] = 1.0
        times_jacobian(unit, rows, work.g, work.g2, e, storage.phi_d)
        for i in range(d):
            r = storage.kept[i]
            storage.phi_q[i * n + j] = rows.scale[r] * storage.phi_d[r]
    for i in range(d):
        for j in range(d):
            storage.matrix[i * d + j] = storage.phi_q[i * n + j]
    return dense_lu.factorise(d, storage.matrix, storage.swap)


@inner
def _solve(system: System, storage: Storage, rows: Floats, to: Floats) -> None:
    """Find the dependent part of `to` from Φ_d to = -rows."""
    d = storage.kept.size
    for i in range(d):
        r = storage.kept[i]
        storage.right[i] = -system.rows.scale[r] * rows[r]
    dense_lu.solve(d, storage.matrix, storage.swap, storage.right)
    for i in range(d):
        to[storage.order[i]] = storage.right[i]


@inner
def _close(unit: Unit, system: System, work: Work, storage: Storage) -> tuple[int, int]:
    """Dependent q from z by Newton, with the LU of that place; returns (result, iterations)."""
    before = np.inf
    for count in range(1, 21):
        if not _factorise(unit, system, work, storage):
            return SINGULAR, count
        gap = opening_without_slips(unit, system.rows, work.q, storage.phi)
        if gap <= _CLOSED * system.size or (gap > 0.5 * before and gap <= _ENOUGH * system.size):
            return OK, count
        before = gap
        zero(work.qdd)
        _solve(system, storage, storage.phi, work.qdd)
        for i in range(storage.order.size):
            work.q[i] += work.qdd[i]
    return FOLDED, 20


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
    """ẏ = (q̇, z̈); returns (result, iterations)."""
    n, d = storage.order.size, storage.kept.size
    f = n - d
    y, R, MR, order = storage.y, storage.R, storage.MR, storage.order
    at = stage * (n + f)
    for i in range(n):
        work.q[i] = y[i]
    result, count = _close(unit, system, work, storage)
    if result != OK:
        return result, count
    for j in range(f):  # Φ_q R = 0
        for i in range(d):
            storage.right[i] = -storage.phi_q[i * n + d + j]
        dense_lu.solve(d, storage.matrix, storage.swap, storage.right)
        for i in range(d):
            R[order[i] * f + j] = storage.right[i]
        for i in range(f):
            R[order[d + i] * f + j] = 1.0 if i == j else 0.0
    for i in range(n):
        work.qd[i] = 0.0
        for j in range(f):
            work.qd[i] += R[i * f + j] * y[n + j]
    zero(work.qdd)
    bias(unit, system, work, storage.c)
    _solve(system, storage, storage.c, work.qdd)  # Ṙ ż
    applied_forces(forces.effects, t, work.q, work.qd, work.near, work.Q)
    add_mass_times(unit, system.mass, -1.0, work.qdd, work.Q)
    for j in range(f):
        zero(work.delta)
        zero(work.p)
        for i in range(n):
            work.delta[i] = R[i * f + j]
        add_mass_times(unit, system.mass, 1.0 / storage.mass_scale, work.delta, work.p)
        for i in range(n):
            MR[i * f + j] = work.p[i]
    for a in range(f):
        storage.right[a] = 0.0
        for i in range(n):
            storage.right[a] += R[i * f + a] * work.Q[i] / storage.mass_scale
        for b in range(f):
            storage.matrix[a * f + b] = 0.0
            for i in range(n):
                storage.matrix[a * f + b] += R[i * f + a] * MR[i * f + b]
    if not dense_lu.factorise(f, storage.matrix, storage.swap):
        return SINGULAR, count
    dense_lu.solve(f, storage.matrix, storage.swap, storage.right)  # z̈, eq. (15)
    for i in range(n):
        storage.k[at + i] = work.qd[i]
    for j in range(f):
        storage.k[at + n + j] = storage.right[j]
    return OK, count


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

"""Null spaces of Φ_q and of its transpose, from the factor of A.

A⁻¹M = 1 - A⁻¹ Φ_qᵀ α Φ_q leaves a part 1 / (1 + s²) of a mode with s² = penalty σ². So a few
passes over random vectors leave the directions that are free, and 1 - α^½ Φ_q A⁻¹ Φ_qᵀ α^½ the
combinations of rows that depend on one another. σ is known to about 1e-12.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel import System, Work
from alf_ros.model.compile import Model
from alf_ros.model.massless_directions import no_mass
from alf_ros.model.rank import effective_rank

_PASSES = 3  # of the projection onto a null space
_MORE = 2  # vectors beyond those expected


def linearise(model: Model, system: System, work: Work) -> None:
    """Φ_q and the factor of A at work.q. Raises AssemblyError if there is no factor."""
    if not kernel.linearise(model.unit, system, work, work.q):
        raise no_mass(model, work.q)


def free_directions(model: Model, system: System, work: Work) -> tuple[Floats, Floats]:
    """Directions (d, blocks D), orthonormal in the metric of M, and the singular value σ of each:
    for all with s² = penalty σ² < 1. In this form rounding falls with the remaining error.
    """
    n, rows, unit = model.n, system.rows, model.unit
    expected = n - effective_rank(replace(model, system=system), work)
    count = min(n, int(np.ceil(expected)) + _MORE)
    X = np.zeros((count, model.q.size))
    X[:, :n] = np.random.default_rng(0).standard_normal((count, n))
    rate, forms = np.zeros(rows.alpha.size), np.zeros((count, rows.alpha.size))
    for _ in range(_PASSES):
        for x in X:
            kernel.times_jacobian(unit, rows, work.g, work.g2, x, rate)
            x[:n] -= _held(model, system, work, rows.alpha * rate)[:n]
        X[:, :n] = np.linalg.qr(X[:, :n].T)[0].T
    momenta = np.zeros((count, n))
    for x, p, form in zip(X, momenta, forms, strict=True):
        kernel.add_mass_times(unit, system.mass, 1.0, x, p)
        kernel.times_jacobian(unit, rows, work.g, work.g2, x, form)
    stiff = (forms * rows.alpha) @ forms.T
    try:
        share, vectors = eigh(stiff, stiff + X[:, :n] @ momenta.T)  # s² / (1 + s²)
    except np.linalg.LinAlgError:
        raise AssemblyError(
            'lengths or masses differ by more than 64-bit numbers resolve', key='mechanism'
        ) from None
    kept = share < 0.5
    share = np.clip(share[kept], 0.0, None)
    directions = (vectors[:, kept] / np.sqrt(1.0 - share)).T @ X
    return directions, np.sqrt(share / (1.0 - share) / system.penalty)


def dependent_rows(model: Model, work: Work) -> tuple[Floats, Floats]:
    """Left null vectors n (k, rows), nᵀ Φ_q = 0, and the σ of each; rows in the kernel's order."""
    system, unit = model.system, model.unit
    rows, root = system.rows, np.sqrt(system.rows.alpha)
    m = root.size
    expected = m - effective_rank(model, work)
    count = min(m, int(np.ceil(expected)) + _MORE)
    Y = np.random.default_rng(0).standard_normal((count, m))
    rate = np.zeros(m)
    for _ in range(_PASSES):
        for y in Y:
            x = _held(model, system, work, root * y)
            kernel.times_jacobian(unit, rows, work.g, work.g2, x, rate)
            y -= root * rate
        Y = np.linalg.qr(Y.T)[0].T
    G = np.zeros((count, model.q.size))
    for y, g in zip(Y, G, strict=True):
        kernel.add_transposed(unit, rows, work.g, work.g2, root * y, g)
    solved = np.array([_held(model, system, work, root * y) for y in Y]).reshape(G.shape)
    share, vectors = np.linalg.eigh(G[:, : model.n] @ solved[:, : model.n].T)
    kept = share < 0.5
    share = np.clip(share[kept], 0.0, None)
    return (vectors[:, kept].T @ Y) * root, np.sqrt(share / (1.0 - share) / system.penalty)


def _held(model: Model, system: System, work: Work, y: Floats) -> Floats:
    """(blocks D,) A⁻¹ Φ_qᵀ y, 0 for what does not move."""
    x = np.zeros(model.q.size)
    kernel.add_transposed(model.unit, system.rows, work.g, work.g2, y, x)
    x[model.n :] = 0.0
    kernel.solve(model.unit, system.pattern, work.diagonal, work.off, x)
    return x


def convective(model: Model, qd: Floats) -> Floats:
    """(rows,) Φ̇_q q̇ of q̇ (blocks D, m/s)."""
    rows = model.system.rows
    rate, out = np.zeros(rows.b.size), np.zeros(rows.alpha.size)
    kernel.jacobian_rate(model.unit, rows, qd, rate)
    kernel.convective(model.unit, rows, rate, qd, out)
    return out

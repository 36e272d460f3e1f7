"""The mass that a light block carries: what its rows feel.

The penalty of a row is as large as the mass of its lightest block. A link almost without inertia
between two heavy ones, as many URDF have, would bind these by rows far too soft. In the free
motions of the mechanism such a block moves the masses on both sides: its apparent mass is
1 / λ, λ the largest eigenvalue of its part of N (Nᵀ M N)⁻¹ Nᵀ, with N the null space of Φ_q. The
apparent mass of a light part at the end of a chain, or of a rod that spins, is its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Floats, Unit
from alf_ros.kernel import System

_LIGHT = 1e-6  # of the heaviest block
_MORE = 10.0  # times its own: an apparent mass that counts
_DENSE = 1200  # coordinates, up to which it is looked for
_DEPENDENT = 1e-9  # of the largest singular value
_NOTHING = 1e-15  # of the largest mass of free motions


def have_light(diagonal: Floats) -> NDArray[np.bool_]:
    """(...,) whether mechanisms with M of this diagonal (..., movable) have light blocks."""
    return np.asarray(_are_light(diagonal).any(axis=-1))


def _are_light(diagonal: Floats) -> NDArray[np.bool_]:
    heaviest = diagonal.max(axis=-1, initial=0.0, keepdims=True)
    return np.asarray((diagonal > 0.0) & (diagonal < _LIGHT * heaviest))


def are_small_and_light(unit: Unit, system: System) -> bool:
    """Whether a mechanism has light blocks, and is small enough for dense matrices."""
    diagonal = system.mass.diagonal
    return diagonal.size * len(unit) <= _DENSE and bool(_are_light(diagonal).any())


def carried(unit: Unit, system: System, q: Floats) -> Floats:
    """(movable,) the diagonal of M, kg, in which light blocks count with what they carry.

    Blocks without mass are left without. q (blocks D, m): as drawn.
    """
    diagonal, D = system.mass.diagonal, len(unit)
    if not are_small_and_light(unit, system):
        return diagonal
    light, n = _are_light(diagonal), diagonal.size * D
    J, M = _dense(unit, system, q, n)
    _, sizes, turn = np.linalg.svd(J)
    rank = int((sizes > _DEPENDENT * sizes.max(initial=0.0)).sum())
    N = turn[rank:].T
    values, vectors = np.linalg.eigh(N.T @ M @ N)
    least = _NOTHING * values.max(initial=0.0)
    W = (N @ vectors) / np.sqrt(np.maximum(values, least or 1.0))
    found = diagonal.copy()
    for block in np.flatnonzero(light):
        part = W[block * D : block * D + D]
        moves = float(np.linalg.norm(part, 2)) if part.size else 0.0
        apparent = min(1.0 / moves**2 if moves > 0.0 else np.inf, float(diagonal.max()))
        if apparent > _MORE * diagonal[block]:
            found[block] = apparent
    return found


def _dense(unit: Unit, system: System, q: Floats, n: int) -> tuple[Floats, Floats]:
    """Φ_q (rows, n), each row of length 1, and M (n, n) kg."""
    rows, D = system.rows, len(unit)
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian(unit, rows, q, g, g2)
    J, M = np.zeros((n, rows.alpha.size)), np.zeros((n, n))
    for k, x in enumerate(np.eye(n, q.size)):
        kernel.times_jacobian(unit, rows, g, g2, x, J[k])
        kernel.add_mass_times(unit, system.mass, 1.0, x, M[k])
    size = np.linalg.norm(J, axis=0)
    return (J / np.where(size > 0.0, size, 1.0)).T, M

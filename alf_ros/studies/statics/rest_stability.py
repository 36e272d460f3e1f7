"""Whether a position of rest is stable, from the reduced Hessian Zᵀ (K + Σ λ_k H_k) Z.

Of conservative loads its eigenvalues ω² (1/s²) are the squares of the natural frequencies. All
are positive at a minimum of the potential. In the direction of a negative one the mechanism falls.
In the direction of one that is zero to rounding the loads do no work of second order. Σ λ_k H_k is
the stiffness that reactions give. On free directions it does not depend on which λ of redundant
rows is taken, because nᵀ Φ(q) = 0 on all positions that the rows allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.statics.instant import Instant

STABLE, UNSTABLE, NEUTRAL = 'stable', 'unstable', 'neutral'
NEUTRAL_PART = 1e-9  # ω² of the terms that it is the sum of, from which down it counts as zero
_SYMMETRIC = 1e-7  # of the Hessian, that its skew part may be


@dataclass(frozen=True, eq=False)
class RestStability:
    """verdict: STABLE, UNSTABLE or NEUTRAL. stiffness (f,): ω², 1/s², ascending. directions
    (f, n): of each in the kernel's order, with unit mass, kg^-½. conservative: whether the loads
    have a potential to second order."""

    verdict: str
    stiffness: Floats
    directions: Floats
    conservative: bool


def reduced_stiffness(instant: Instant, lam: Floats) -> tuple[Floats, float]:
    """(f, f) Zᵀ (K + Σ λ_k H_k) Z, 1/s², and how large the terms are that it is the sum of."""
    Z = instant.velocity_directions
    H = instant.K + instant.curvature(lam)
    size = float((np.abs(Z.T) @ (np.abs(H) @ np.abs(Z))).max(initial=0.0))
    return np.asarray(Z.T @ (H @ Z)), size


def without_rounding(squares: Floats, size: float) -> Floats:
    """ω² (1/s²) of the reduced stiffness; zero where terms as large as `size` leave rounding."""
    return np.where(np.abs(squares) > NEUTRAL_PART * size, squares, 0.0)


def stability_of(instant: Instant, lam: Floats) -> RestStability:
    """Of an instant at rest with λ (rows,) in the kernel's order. Raises InputError if a free
    motion has no mass, or the mechanism is too large for dense matrices."""
    Z = instant.velocity_directions
    found, size = reduced_stiffness(instant, lam)
    skew = float(np.abs(found - found.T).max(initial=0.0))
    conservative = skew <= _SYMMETRIC * size
    values, turn = np.linalg.eigh(0.5 * (found + found.T))
    deciding = values
    if not conservative:  # flutter too: a pair of complex ω² grows
        squares = np.linalg.eigvals(found)
        grows = np.abs(squares.imag) > _SYMMETRIC * size
        deciding = np.where(grows, -np.abs(squares), squares.real)
    least = float(deciding.min(initial=np.inf))
    nothing = NEUTRAL_PART * size
    verdict = STABLE if least > nothing else NEUTRAL if least >= -nothing else UNSTABLE
    return RestStability(verdict, without_rounding(values, size), (Z @ turn).T, conservative)

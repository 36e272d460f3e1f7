"""Whether a position of rest is stable, from the reduced Hessian Zᵀ (K + Σ λ_k H_k) Z.

Of conservative loads its eigenvalues ω² (1/s²) are the squares of the natural frequencies. All
are positive at a minimum of the potential. In the direction of a negative one the mechanism falls.
In the direction of one that is zero to rounding the loads do no work of second order. Σ λ_k H_k is
the stiffness that reactions give. On free directions it does not depend on which λ of redundant
rows is taken, because nᵀ Φ(q) = 0 on all positions that the rows allow.

Damping that only takes energy does not change this. Where the loads have no potential, or damping
gives energy, the eigenvalues of the linear motion decide, with damping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.statics.instant import Instant

STABLE, UNSTABLE, NEUTRAL = 'stable', 'unstable', 'neutral'
NEUTRAL_PART = 1e-9  # ω² of the terms that it is the sum of, from which down it counts as zero
SYMMETRIC = 1e-7  # of the Hessian, that its skew part may be
_DRAINING = 1e-9  # of the damping: what rounding may leave of none
# of the fastest eigenvalue of the motion: what rounding may leave of none, and of a double one
_GROWING, _GROWING_TWICE = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class ReducedModes:
    """Modes of the free directions, (f,) each, the lowest ω² first.

    squares: ω², 1/s²; NaN of a pair that grows as it oscillates (flutter). motions (f, n): in the
    kernel's order, of unit mass, kg^-½. partners (f, n): their left partners, of which the product
    with M and the motion is 1; the motions themselves where the loads have a potential.
    """

    squares: Floats
    motions: Floats
    partners: Floats
    conservative: bool


@dataclass(frozen=True, eq=False)
class RestStability:
    """verdict: STABLE, UNSTABLE or NEUTRAL. stiffness (f,), directions (f, n): ω² and motions, as
    in `ReducedModes`. conservative: whether the loads have a potential to second order.
    draining: whether no motion gains energy from the damping. growth: the largest real part of the
    eigenvalues of the linear motion, 1/s; None where the Hessian decides alone."""

    verdict: str
    stiffness: Floats
    directions: Floats
    conservative: bool
    draining: bool
    growth: float | None = None


def reduced_stiffness(instant: Instant, lam: Floats) -> tuple[Floats, float]:
    """(f, f) Zᵀ (K + Σ λ_k H_k) Z, 1/s², and how large the terms are that it is the sum of."""
    Z = instant.velocity_directions
    K, L = instant.K, instant.curvature(lam)
    terms = abs(K) + abs(L)
    size = float((np.abs(Z.T) @ (terms @ np.abs(Z))).max(initial=0.0))
    return np.asarray(Z.T @ ((K + L) @ Z)), size


def reduced_modes(instant: Instant, stiffness: Floats, size: float) -> ReducedModes:
    """The modes without damping, of the reduced stiffness and its size."""
    Z = instant.velocity_directions
    skew = float(np.abs(stiffness - stiffness.T).max(initial=0.0))
    if skew <= SYMMETRIC * size:
        values, turn = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
        motions = (Z @ turn).T
        return ReducedModes(_without_rounding(values, size), motions, motions, True)
    found, vectors = np.linalg.eig(stiffness)
    grow = np.abs(found.imag) > SYMMETRIC * size
    order = np.lexsort((found.imag, found.real, grow))
    found, vectors, grow = found[order], vectors[:, order], grow[order]
    # of a pair that is complex, real and imaginary part span the motion
    real = np.where(grow & (found.imag < 0.0), vectors.imag, vectors.real)
    real /= np.linalg.norm(real, axis=0)
    squares = np.where(grow, np.nan, _without_rounding(found.real, size))
    partners = (Z @ np.linalg.pinv(real).T).T
    return ReducedModes(squares, (Z @ real).T, partners, False)


def _without_rounding(squares: Floats, size: float) -> Floats:
    """ω² (1/s²) of the reduced stiffness; zero where terms as large as `size` leave rounding."""
    return np.where(np.abs(squares) > NEUTRAL_PART * size, squares, 0.0)


def stability_of(instant: Instant, lam: Floats) -> RestStability:
    """Of an instant at rest with λ (rows,) in the kernel's order. Raises InputError if a free
    motion has no mass, or the mechanism is too large for dense matrices."""
    Z = instant.velocity_directions
    stiffness, size = reduced_stiffness(instant, lam)
    found = reduced_modes(instant, stiffness, size)
    damping = np.asarray(Z.T @ (instant.C @ Z))
    gains = np.linalg.eigvalsh(0.5 * (damping + damping.T)).min(initial=0.0)
    draining = bool(gains >= -_DRAINING * np.abs(damping).max(initial=0.0))
    least = float(found.squares.min(initial=np.inf))  # not a number, if a pair grows
    verdict = STABLE if least > 0.0 else NEUTRAL if least == 0.0 else UNSTABLE
    growth = None
    # where loads have no potential, damping may make a motion grow that is stable without it
    if damping.any() and not (found.conservative and draining):
        fastest, growth = _growth(stiffness, damping)
        rounding = (_GROWING_TWICE if verdict == NEUTRAL else _GROWING) * fastest
        if growth > rounding:
            verdict = UNSTABLE
        elif verdict == UNSTABLE:  # damping may also hold what grows without it
            verdict = STABLE if growth < -rounding else NEUTRAL
    return RestStability(
        verdict, found.squares, found.motions, found.conservative, draining, growth
    )


def growing_motion(instant: Instant, lam: Floats) -> Floats:
    """(n,) the displacement of the motion that grows fastest, when its largest number is."""
    Z = instant.velocity_directions
    stiffness, _ = reduced_stiffness(instant, lam)
    values, vectors = np.linalg.eig(_motion(stiffness, np.asarray(Z.T @ (instant.C @ Z))))
    found = Z @ vectors[: len(stiffness), np.argmax(values.real)]
    return np.asarray((found / found[np.argmax(np.abs(found))]).real)


def _growth(stiffness: Floats, damping: Floats) -> tuple[float, float]:
    """The largest magnitude, and the largest real part, of the eigenvalues of the linear motion,
    1/s."""
    values = np.linalg.eigvals(_motion(stiffness, damping))
    return float(np.abs(values).max(initial=0.0)), float(values.real.max(initial=-np.inf))


def _motion(stiffness: Floats, damping: Floats) -> Floats:
    """(2 f, 2 f) of positions and velocities."""
    f = len(stiffness)
    return np.block([[np.zeros((f, f)), np.eye(f)], [-stiffness, -damping]])

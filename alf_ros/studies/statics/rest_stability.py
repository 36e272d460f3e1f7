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

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.statics.instant import Instant
from alf_ros.studies.statics.sparse_rows import Sparse

STABLE, UNSTABLE, NEUTRAL = 'stable', 'unstable', 'neutral'
SYMMETRIC = 1e-7  # of the terms of two motions, that the skew part between them may be
_NEUTRAL = 1e-9  # ω² of the terms that it is the sum of, from which down it counts as zero
_DRAINING = 1e-9  # of the damping of a motion: what rounding may leave of none
_GROWING = 1e-9  # of an eigenvalue of the motion: what rounding may leave of none
_SOLVED = 1e-14  # of the largest number of a matrix: what its eigenvalues may be off by
_ROUNDING = float(np.finfo(float).eps)  # of the largest reaction, in others


@dataclass(frozen=True, eq=False)
class ReducedStiffness:
    """H = Zᵀ (K + Σ λ_k H_k) Z on the free directions, and what it is the sum of.

    matrix (f, f): H, 1/s². whole (n, n): K + Σ λ_k H_k, N/m. terms (n, n): magnitudes, N/m.
    Z (n, f), kg^-½. loaded (n, n): Σ λ_k H_k in magnitudes, N/m, if all rows had the largest
    reaction.
    """

    matrix: Floats
    whole: Sparse
    terms: Sparse
    Z: Floats
    loaded: Sparse

    @cached_property
    def size(self) -> float:
        """How large the largest terms are, 1/s²."""
        return self._largest(self.terms)

    def _largest(self, terms: Sparse) -> float:
        return float((np.abs(self.Z.T) @ (terms @ np.abs(self.Z))).max(initial=0.0))

    def sums(self, motions: Floats) -> Floats:
        """(k,) how large the terms are that ω² of motions (k, n) is the sum of, 1/s²."""
        shapes = np.abs(motions)
        return np.asarray(np.einsum('kn,nk->k', shapes, self.terms @ shapes.T), dtype=float)

    @cached_property
    def solved(self) -> float:
        """The possible error of eigenvalues, 1/s². A reaction that is zero is rounding of the
        largest one, and gives a stiffness."""
        largest = float(np.abs(self.matrix).max(initial=0.0))
        return _SOLVED * largest + _ROUNDING * self._largest(self.loaded)

    def rounding(self, motions: Floats) -> Floats:
        """(k,) the rounding of an ω² that is zero, of motions (k, n), 1/s²."""
        return _NEUTRAL * self.sums(motions) + self.solved

    @cached_property
    def symmetric(self) -> tuple[Floats, Floats]:
        """(f,) eigenvalues of its symmetric part, 1/s², ascending, and motions (f, n), kg^-½."""
        values, turn = self._solved
        return values, (self.Z @ turn).T

    @cached_property
    def _solved(self) -> tuple[Floats, Floats]:
        values, turn = np.linalg.eigh(0.5 * (self.matrix + self.matrix.T))
        return np.asarray(values, dtype=float), np.asarray(turn, dtype=float)

    @cached_property
    def conservative(self) -> bool:
        """Whether it is symmetric: the loads have a potential to second order."""
        _, turn = self._solved
        skew = turn.T @ (self.matrix - self.matrix.T) @ turn
        scale = np.sqrt(self.sums(self.symmetric[1]))
        return bool((np.abs(skew) <= SYMMETRIC * np.outer(scale, scale) + self.solved).all())


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


def reduced_stiffness(instant: Instant, lam: Floats) -> ReducedStiffness:
    """Of an instant with λ (rows,) in the kernel's order. Raises InputError if a free motion has
    no mass, or the mechanism is too large for dense matrices."""
    Z, whole = instant.velocity_directions, instant.K + instant.curvature(lam)
    # reactions of two rows may cancel in Σ λ_k H_k, as of bars that lie on each other
    terms = abs(instant.K) + instant.curvature(lam, sizes=True)
    scale = instant.model.system.rows.scale
    forces = np.divide(np.abs(lam), scale, out=np.zeros(scale.size), where=scale > 0.0)  # N
    loaded = instant.curvature(scale * forces.max(initial=0.0), sizes=True)
    return ReducedStiffness(np.asarray(Z.T @ (whole @ Z)), whole, terms, Z, loaded)


def reduced_modes(stiffness: ReducedStiffness) -> ReducedModes:
    """The modes without damping."""
    if stiffness.conservative:
        values, motions = stiffness.symmetric
        squares = np.where(np.abs(values) > stiffness.rounding(motions), values, 0.0)
        return ReducedModes(squares, motions, motions)
    found, vectors = np.linalg.eig(stiffness.matrix)
    both = [(stiffness.Z @ part).T for part in (vectors.real, vectors.imag)]
    sums, rounding = (sum(of(x) for x in both) for of in (stiffness.sums, stiffness.rounding))
    grow = np.abs(found.imag) > SYMMETRIC * sums + stiffness.solved
    squares = np.where(np.abs(found.real) > rounding, found.real, 0.0)
    order = np.lexsort((found.imag, found.real, grow))
    squares = np.where(grow, np.nan, squares)[order]
    # of a pair that is complex, real and imaginary part span the motion
    real = np.where(grow & (found.imag < 0.0), vectors.imag, vectors.real)[:, order]
    real /= np.linalg.norm(real, axis=0)
    partners = (stiffness.Z @ np.linalg.pinv(real).T).T
    return ReducedModes(squares, (stiffness.Z @ real).T, partners)


def stability_of(instant: Instant, stiffness: ReducedStiffness) -> RestStability:
    """Of an instant at rest with its `reduced_stiffness`."""
    found, conservative = reduced_modes(stiffness), stiffness.conservative
    Z = instant.velocity_directions
    damping = np.asarray(Z.T @ (instant.C @ Z))
    draining = _drains(instant, damping)
    least = float(found.squares.min(initial=np.inf))  # not a number, if a pair grows
    verdict = STABLE if least > 0.0 else NEUTRAL if least == 0.0 else UNSTABLE
    growth = None
    # where loads have no potential, damping may make a motion grow that is stable without it
    if damping.any() and not (conservative and draining):
        neutral = found.motions[found.squares == 0.0]
        growth, rounding = _growth(stiffness.matrix, damping)
        rounding += math.sqrt(stiffness.rounding(neutral).max(initial=0.0))
        if growth > rounding:
            verdict = UNSTABLE
        elif verdict == UNSTABLE:  # damping may also hold what grows without it
            verdict = STABLE if growth < -rounding else NEUTRAL
    return RestStability(verdict, found.squares, found.motions, conservative, draining, growth)


def _drains(instant: Instant, damping: Floats) -> bool:
    """Whether no motion gains energy from the damping (f, f), 1/s."""
    values, turn = np.linalg.eigh(0.5 * (damping + damping.T))
    shapes = np.abs((instant.velocity_directions @ turn).T)
    sums = np.einsum('kn,nk->k', shapes, abs(instant.C) @ shapes.T)
    solved = _SOLVED * np.abs(damping).max(initial=0.0)
    return bool((values >= -_DRAINING * sums - solved).all())


def growing_motion(instant: Instant, lam: Floats) -> Floats:
    """(n,) the displacement of the motion that grows fastest, when its largest number is."""
    Z, stiffness = instant.velocity_directions, reduced_stiffness(instant, lam).matrix
    values, vectors = np.linalg.eig(_motion(stiffness, np.asarray(Z.T @ (instant.C @ Z))))
    found = Z @ vectors[: len(stiffness), np.argmax(values.real)]
    return np.asarray((found / found[np.argmax(np.abs(found))]).real)


def _growth(stiffness: Floats, damping: Floats) -> tuple[float, float]:
    """The largest real part of the eigenvalues of the linear motion, and what rounding may leave
    of none, 1/s."""
    values = np.linalg.eigvals(_motion(stiffness, damping))
    grows = values[np.argmax(values.real)]
    fastest = float(np.abs(values).max())
    return float(grows.real), _GROWING * float(np.abs(grows)) + _SOLVED * fastest


def _motion(stiffness: Floats, damping: Floats) -> Floats:
    """(2 f, 2 f) of positions and velocities."""
    f = len(stiffness)
    return np.block([[np.zeros((f, f)), np.eye(f)], [-stiffness, -damping]])

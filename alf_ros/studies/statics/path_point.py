"""A point of a path of equilibria, and the linear equations of the path there.

Positions of rest over a number p (`VariedScene`) satisfy Q - Jᵀ λ = 0 and Φ = 0 at p. Small
displacements along them are dq = Z η + U dp: Z the free directions, orthonormal in M, and
J U = -∂Φ/∂p. Along Z, with K and L = Σ λ_k H_k as in `rest_stability`,

    Zᵀ (K + L) Z η - b dp = Zᵀ Q,   b = Zᵀ [∂(Q - Jᵀ λ)/∂p - (K + L) U].

These are f equations for f + 1 unknowns. Rows that are redundant do not enter: b and the matrix
do not depend on which of their λ is taken, because all λ satisfy them at the same positions.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats
from alf_ros.studies.statics.descent import free_rate, pushed
from alf_ros.studies.statics.instant import Instant
from alf_ros.studies.statics.rest_stability import (
    ReducedStiffness,
    RestStability,
    reduced_stiffness,
    stability_of,
)
from alf_ros.studies.statics.sparse_rows import Sparse
from alf_ros.studies.statics.varied_scene import LoadedMechanism, Slopes, VariedScene

Truths = NDArray[np.bool_]
_ZERO = 1e-11  # singular value, of the size of the terms, from which down it is rounding
_PART = 1e-4  # of a length, that a position is moved by if its forces count as left


@dataclass(frozen=True, eq=False)
class PathScales:
    """Scales that make displacements and the number comparable: M (n, n) kg of the scene, a length
    of displacements, kg^½ m, and the range of the number."""

    mass: Sparse
    length: float
    value: float

    def product(self, one: PathDirection, other: PathDirection) -> float:
        """The inner product, without unit."""
        along = float(one.q @ (self.mass @ other.q)) / self.length**2
        return along + one.value * other.value / self.value**2

    def size(self, one: PathDirection) -> float:
        """The length of a displacement on the path, without unit."""
        return float(np.sqrt(self.product(one, one)))


@dataclass(frozen=True, eq=False)
class PathDirection:
    """A displacement q (n,), m, with a change of the number."""

    q: Floats
    value: float

    def times(self, factor: float) -> PathDirection:
        """So many times as long."""
        return PathDirection(factor * self.q, factor * self.value)


class PathPoint:
    """Close to a path, or on it.

    lam (rows,): the multipliers; left: the acceleration that is left, m/s².
    """

    def __init__(
        self,
        varied: VariedScene,
        scales: PathScales,
        value: float,
        instant: Instant,
        slopes: Slopes | None = None,
    ) -> None:
        """`slopes`: by the number, of a point nearby; computed here if absent."""
        self.varied, self.scales, self.value, self.instant = varied, scales, value, instant
        self.mechanism: LoadedMechanism = varied.at(value)
        self._near = slopes
        pull, self.lam = pushed(instant, self.mechanism.solve)
        self.left = float(np.abs(pull).max(initial=0.0))

    def beside(
        self, direction: PathDirection, value: float | None = None, follows: bool = False
    ) -> PathPoint:
        """The point after a displacement, closed. value: of the number there, of the direction if
        absent. `follows`: it uses the slopes of this one. Raises InputError."""
        value = self.value + direction.value if value is None else value
        there = self.varied.at(value).moved(self.instant, direction.q)
        slopes = self.slopes if follows else None
        return PathPoint(self.varied, self.scales, value, there, slopes)

    def settled(self) -> PathPoint:
        """The same with its own slopes."""
        found = copy.copy(self)
        found._near = None
        for of_slopes in ('slopes', 'basis'):
            vars(found).pop(of_slopes, None)
        return found

    @cached_property
    def slopes(self) -> Slopes:
        """By the number."""
        if self._near is not None:
            return self._near
        return self.varied.slopes(self.instant, self.lam, self.value, self.scales.value)

    def since(self, other: PathPoint) -> PathDirection:
        """The displacement from another point."""
        n = self.instant.model.n
        return PathDirection(self.instant.q[:n] - other.instant.q[:n], self.value - other.value)

    @cached_property
    def _reduced(self) -> ReducedStiffness:
        return reduced_stiffness(self.instant, self.lam)

    @cached_property
    def scale(self) -> float:
        """The acceleration that the forces give without rows, or that the stiffness gives over a
        small part of a typical length, m/s²."""
        length = _PART * self.instant.loads.tangents.length
        return max(free_rate(self.instant), self._reduced.size * length)

    @property
    def freedoms(self) -> int:
        """f; more in a singular position."""
        return int(self.instant.velocity_directions.shape[1])

    @cached_property
    def stability(self) -> RestStability:
        """As of a position of rest."""
        return stability_of(self.instant, self._reduced)

    @property
    def stiffness(self) -> Floats:
        """Zᵀ (K + L) Z (f, f), 1/s²."""
        return self._reduced.matrix

    @property
    def squares(self) -> Floats:
        """(f,) eigenvalues of its symmetric part, 1/s², ascending."""
        return self._reduced.symmetric[0]

    @property
    def are_zero(self) -> Truths:
        """(f,) which of them are zero to rounding."""
        squares, motions = self._reduced.symmetric
        return np.asarray(np.abs(squares) <= self._reduced.rounding(motions))

    @cached_property
    def soft(self) -> PathDirection:
        """The displacement along which the stiffness is nearest to zero, of length 1."""
        _, _, Vt = np.linalg.svd(self.stiffness)
        found = PathDirection(self.instant.velocity_directions @ Vt[-1], 0.0)
        return found.times(1.0 / self.scales.size(found))

    @cached_property
    def basis(self) -> tuple[Floats, Floats]:
        """(n, f + 1): the displacement of each unknown (without unit); and the equations
        (f, f + 1), m kg^½/s² over their size."""
        instant, scales = self.instant, self.scales
        n, Z = instant.model.n, instant.velocity_directions
        slopes = self.slopes
        J = instant.J_of_movable
        self.mechanism.solve.factorise(instant.M, J, instant.q)
        U = self.mechanism.solve.solve(np.zeros(n), -slopes.gap)[0]
        b = Z.T @ (slopes.force - self._reduced.whole @ U)
        equations = np.column_stack([self.stiffness * scales.length, -b * scales.value])
        return np.column_stack([Z * scales.length, U * scales.value]), equations

    def _row(self, normal: PathDirection) -> Floats:
        """(f + 1,) the inner product of `normal` with each unknown."""
        basis, _ = self.basis
        row = (normal.q @ (self.scales.mass @ basis)) / self.scales.length**2
        row[-1] += normal.value / self.scales.value
        return np.asarray(row)

    def _displacement(self, x: Floats) -> PathDirection:
        basis, _ = self.basis
        return PathDirection(basis @ x, float(x[-1]) * self.scales.value)

    def step(self, normal: PathDirection, offset: float) -> PathDirection:
        """Newton's step onto the path, in the plane at `offset` along a direction."""
        _, equations = self.basis
        size = float(np.abs(equations).max(initial=0.0)) or 1.0
        n = self.instant.model.n
        force = self.instant.velocity_directions.T @ self.instant.Q[:n]
        matrix = np.vstack([equations / size, self._row(normal)])
        right = np.concatenate([force / size, [offset]])
        return self._displacement(np.linalg.lstsq(matrix, right, rcond=_ZERO)[0])

    def tangent(self, before: PathDirection) -> PathDirection:
        """The direction of the path, of length 1, that continues another one."""
        _, equations = self.basis
        _, s, Vt = np.linalg.svd(equations)
        rank = int((s > _ZERO * s.max(initial=0.0)).sum())
        null = Vt[rank:]
        along = self._row(before)
        x = null.T @ (null @ along)
        if np.linalg.norm(x) < 1e-6 * max(float(np.linalg.norm(along)), 1e-300):
            x = null[-1]
        found = self._displacement(x)
        return found.times(1.0 / self.scales.size(found))

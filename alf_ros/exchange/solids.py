"""Volume, centroid and second moments of solids: closed formulas, and the sum over a closed mesh.

Of a solid of density 1 with volume V and centroid c, S = ∫ (x - c) (x - c)ᵀ dV is the matrix of
its second moments, and tr(S) 1 - S its inertia about c. An affine map x -> A x + b makes V |det A|
and S |det A| A S Aᵀ, so that any scale of a shape is exact: a scaled sphere is an ellipsoid.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats, Integers

_FLAT = 1e-12  # of the cube of its size: the volume of a mesh that encloses nothing


@dataclass(frozen=True, eq=False)
class Solid:
    """volume: m^3. centroid (3,): m. second (3, 3): m^5, about the centroid."""

    volume: float
    centroid: Floats
    second: Floats

    def mapped(self, matrix: Floats, origin: Floats) -> Solid:
        """The solid of all points matrix (3, 3) x + origin (3,)."""
        factor = abs(float(np.linalg.det(matrix)))
        second = factor * (matrix @ self.second @ matrix.T)
        return Solid(factor * self.volume, matrix @ self.centroid + origin, second)

    @property
    def inertia(self) -> Floats:
        """(3, 3) about the centroid, of density 1, m^5."""
        return np.trace(self.second) * np.eye(3) - self.second


def box(x: float, y: float, z: float) -> Solid:
    """Of these edges, m."""
    return _centred(x * y * z, (x * x / 12.0, y * y / 12.0, z * z / 12.0))


def sphere(radius: float) -> Solid:
    """Of a radius in m."""
    return _centred(4.0 / 3.0 * math.pi * radius**3, (radius**2 / 5.0,) * 3)


def cylinder(radius: float, length: float) -> Solid:
    """Along z; m."""
    across = radius**2 / 4.0
    return _centred(math.pi * radius**2 * length, (across, across, length**2 / 12.0))


def capsule(radius: float, length: float) -> Solid:
    """Along z, `length` without the two half-spheres; m."""
    round_off, between = sphere(radius), cylinder(radius, length)
    along = length**2 / 4.0 + 3.0 / 8.0 * length * radius  # of a half-sphere beside its own
    second = between.second + round_off.second
    second[2, 2] += round_off.volume * along
    return Solid(between.volume + round_off.volume, np.zeros(3), second)


def cone(radius: float, length: float) -> Solid:
    """Along z, with its middle at the origin and its tip at length / 2; m."""
    across = 3.0 / 20.0 * radius**2
    found = _centred(math.pi * radius**2 * length / 3.0, (across, across, 3.0 / 80.0 * length**2))
    return Solid(found.volume, np.array([0.0, 0.0, -length / 4.0]), found.second)


def closed_mesh(corners: Floats, faces: Integers) -> Solid:
    """Of a mesh with corners (n, 3) in m and triangles (m, 3): the sum of the tetrahedra between
    the triangles and a point. Raises ValueError for a mesh that does not enclose a volume."""
    edges = Counter[tuple[int, int]]()
    for one, other in ((0, 1), (1, 2), (2, 0)):
        edges.update(zip(faces[:, one].tolist(), faces[:, other].tolist(), strict=True))
    if not edges or any(edges[b, a] != count for (a, b), count in edges.items()):
        raise ValueError('not closed')
    middle = corners.mean(axis=0)  # near the mesh, so that nothing cancels
    a, b, c = (corners[faces[:, n]] - middle for n in range(3))
    volumes = np.einsum('ni,ni->n', a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    if abs(volume) <= _FLAT * float(np.abs(corners - middle).max()) ** 3:
        raise ValueError('flat')
    total = a + b + c
    centroid = volumes @ total / (4.0 * volume)
    second = sum(np.einsum('n,ni,nj->ij', volumes, x, x) for x in (a, b, c, total)) / 20.0
    second = np.sign(volume) * (second - volume * np.outer(centroid, centroid))
    return Solid(abs(volume), centroid + middle, second)


def _centred(volume: float, second: tuple[float, float, float]) -> Solid:
    """second: diagonal, of volume 1."""
    return Solid(volume, np.zeros(3), volume * np.diag(second))

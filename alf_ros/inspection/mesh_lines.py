"""Lines of a mesh for drawings: its contour as seen from a side, and its sharp edges."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.mesh_triangles import MeshTriangles

_SHARP = np.cos(np.radians(40.0))  # of the angle between two normals
_SAME = 1e-6  # of the bounding box: vertices that are closer are one


class MeshLines:
    """The edges of a mesh with the triangles beside them, in the axes of its file."""

    def __init__(self, mesh: MeshTriangles, factors: Floats) -> None:
        at, one = np.unique(np.round(mesh.vertices / _SAME), axis=0, return_inverse=True)
        self.places = factors * (mesh.middle + mesh.halves * (_SAME * at))
        faces = one.reshape(-1)[mesh.faces.astype(np.int64)]
        a, b, c = (self.places[faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        size = np.linalg.norm(normals, axis=1)
        solid = size > 0.0
        self._normals = np.vstack([normals[solid] / size[solid, None], np.zeros(3)])
        sides = np.sort(faces[solid][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        of = np.repeat(np.arange(solid.sum()), 3)
        order = np.lexsort(sides.T)
        sides, of = sides[order], of[order]
        first = np.ones(len(sides), dtype=bool)
        first[1:] = (sides[1:] != sides[:-1]).any(axis=1)
        begin = np.flatnonzero(first)
        count = np.diff(np.append(begin, len(sides)))
        self._edges, self._one = sides[begin], of[begin]
        # an edge of one triangle, or of more than two, is an end of the surface
        self._pairs = count == 2
        self._other = np.where(self._pairs, of[np.minimum(begin + 1, len(of) - 1)], -1)

    def seen_along(self, direction: Floats) -> Floats:
        """(3 k, 3) m: k lines, each of two places and a row of NaN behind it."""
        one, other = self._normals[self._one], self._normals[self._other]
        turned = (one @ direction > 0.0) != (other @ direction > 0.0)
        sharp = np.sum(one * other, axis=1) < _SHARP
        ends = self.places[self._edges[turned | sharp | ~self._pairs]]
        gaps = np.full((len(ends), 1, 3), np.nan)
        lines: Floats = np.concatenate([ends, gaps], axis=1).reshape(-1, 3)
        return lines

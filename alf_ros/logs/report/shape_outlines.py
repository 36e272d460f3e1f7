"""Outlines of shapes in a parallel projection, from their middles and the ends of half axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.convex_outline import outline
from alf_ros.inspection.mesh_triangles import MeshTriangles
from alf_ros.mechanism import VisualShape

_CORNERS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T
_TURNS = np.linspace(0.0, 2.0 * np.pi, 37)[:-1]
_RIM = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_RIMS = np.vstack([np.column_stack([_RIM, np.full(len(_RIM), end)]) for end in (-1.0, 1.0)])


def outlines(
    shapes: Sequence[VisualShape], meshes: Mapping[str, MeshTriangles], places: Floats
) -> list[Floats]:
    """A convex polygon (k, 2) m for each box, cylinder, sphere or mesh, on the picture.

    meshes: by file. places: (4 n, 2) m, the places of `DrawnShapes` on the picture.
    """
    found = []
    for shape, (middle, *ends) in zip(shapes, places.reshape(-1, 4, 2), strict=True):
        if shape.kind == 'sphere':  # round from every side
            found.append(middle + shape.size[0] * _RIM)
            continue
        if shape.kind == 'mesh':
            corners = meshes[shape.file].extremes
        else:
            corners = _CORNERS if shape.kind == 'box' else _RIMS
        found.append(outline(middle + corners @ (np.array(ends) - middle)))
    return found

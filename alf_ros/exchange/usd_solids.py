"""The solids of shapes in a USD stage: primitives, and closed meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from alf_ros.arrays import Floats, Integers
from alf_ros.exchange import solids
from alf_ros.exchange.solids import Solid
from alf_ros.exchange.usd_stage import ENDLESS, UsdStage

# Turns the z axis into each axis of the file.
TO_AXIS = {
    'X': np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    'Y': np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    'Z': np.eye(3),
}
_ROUND = {'Cylinder': solids.cylinder, 'Capsule': solids.capsule, 'Cone': solids.cone}
_AS_IT_IS = ('none', 'meshSimplification', 'convexDecomposition')  # about the mesh itself


def solid_of(stage: UsdStage, prim: Any) -> Solid:
    """The solid of a shape in the world, m. Raises InputError for one that has none."""
    found = _local(stage, prim).mapped(*stage.affine(prim))
    if not found.volume > 0.0:
        raise _unknown(stage, prim, 'it has no volume')
    return found


def sizes(stage: UsdStage, prim: Any) -> tuple[float, ...]:
    """Of a primitive, in its own unit: edge; radius; or radius and height. Raises InputError."""
    kind = str(prim.GetTypeName())
    found = []
    for name in {'Cube': ('size',), 'Sphere': ('radius',)}.get(kind, ('radius', 'height')):
        size = stage.number(prim, name)
        if not size > 0.0 and not (size == 0.0 and kind == 'Capsule' and name == 'height'):
            raise stage.error(f'{prim.GetPath()} {name}', 'not a size', value=size)
        found.append(size)
    return tuple(found)


def along(stage: UsdStage, prim: Any) -> Floats:
    """(3, 3) the axes of a cylinder, capsule or cone along z, in the frame of the prim."""
    return TO_AXIS[stage.choice(prim, 'axis', 'Z', tuple(TO_AXIS))]


def _local(stage: UsdStage, prim: Any) -> Solid:
    """In the coordinates of the prim."""
    kind = str(prim.GetTypeName())
    if kind == 'Cube':
        (edge,) = sizes(stage, prim)
        return solids.box(edge, edge, edge)
    if kind == 'Sphere':
        return solids.sphere(*sizes(stage, prim))
    if kind in _ROUND:
        return _ROUND[kind](*sizes(stage, prim)).mapped(along(stage, prim), np.zeros(3))
    how = stage.word(prim, 'physics:approximation', 'none')
    hull = how == 'convexHull'
    if kind != 'Mesh' or not (hull or how in _AS_IT_IS):
        what = f'{kind} ({how})' if kind == 'Mesh' else kind or 'a prim without type'
        raise _unknown(stage, prim, f'no mass is computed of {what}')
    corners = _corners(stage, prim)
    try:
        if hull:
            return solids.closed_mesh(corners, _hull(corners))
        return solids.closed_mesh(corners, _triangles(stage, prim, len(corners)))
    except (ValueError, QhullError):
        raise _unknown(stage, prim, 'its mesh encloses no volume') from None


def _unknown(stage: UsdStage, prim: Any, message: str) -> Exception:
    expected = 'physics:mass, centerOfMass and diagonalInertia of its body'
    return stage.error(str(prim.GetPath()), message, expected=expected)


def _corners(stage: UsdStage, prim: Any) -> Floats:
    """(n, 3)."""
    found = stage.array(prim, 'points', float)
    if found.ndim != 2 or not np.all(np.abs(found) <= ENDLESS):
        raise _unknown(stage, prim, 'its mesh has no usable points')
    return found


def _triangles(stage: UsdStage, prim: Any, points: int) -> Integers:
    """(m, 3) each face as a fan. Raises ValueError for faces that are none."""
    counts, indices = (
        stage.array(prim, name, np.int64) for name in ('faceVertexCounts', 'faceVertexIndices')
    )
    if counts.sum() != indices.size or not indices.size or counts.min() < 3:
        raise ValueError('no faces')
    if indices.min() < 0 or indices.max() >= points:
        raise ValueError('a corner that is none')
    fans = []
    for first, count in zip((np.cumsum(counts) - counts).tolist(), counts.tolist(), strict=True):
        face = indices[first : first + count]
        rest = [face[1:-1], face[2:]]
        fans.append(np.stack([np.full(count - 2, face[0]), *rest], axis=1))
    return np.concatenate(fans)


def _hull(corners: Floats) -> Integers:
    """(m, 3) the triangles of the convex hull, all outwards."""
    hull = ConvexHull(corners)
    faces = np.array(hull.simplices, dtype=np.int64)
    a, b, c = (corners[faces[:, n]] for n in range(3))
    inwards = np.einsum('ni,ni->n', np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces

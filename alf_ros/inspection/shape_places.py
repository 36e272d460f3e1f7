"""The shapes of a mechanism where they are drawn: in the world, with the frames of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.inspection.mesh_triangles import MeshTriangles
from alf_ros.inspection.missing_meshes import shown_parts
from alf_ros.mechanism import GROUND, Mechanism, VisualShape


@dataclass(frozen=True)
class ShapePlaces:
    """Shapes without capsules. `body` (n,): the number of the body of each, -1 for the ground.
    `at` (n, 3) m and `turn` (n, 4), x y z w: place and axes of each in the frame of its body."""

    shapes: tuple[VisualShape, ...]
    body: NDArray[np.int64]
    at: Floats
    turn: Floats

    def poses(self, frames: Floats) -> Floats:
        """(n, 7) places and axes in the world, x y z (m) and a quaternion x y z w, from the same
        of the bodies, `frames` (bodies, 7)."""
        world = np.vstack([frames, [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]])[self.body]
        u, w = world[:, 3:6], world[:, 6:]
        across = np.cross(u, np.cross(u, self.at) + w * self.at)
        v, c = self.turn[:, :3], self.turn[:, 3:]
        imaginary = w * v + c * u + np.cross(u, v)
        real = w * c - np.sum(u * v, axis=1, keepdims=True)
        return np.hstack([world[:, :3] + self.at + 2.0 * across, imaginary, real])


class DrawnShapes:
    """The shapes that pages and moving pictures draw: all but meshes that are not among those
    read, `meshes` by file."""

    def __init__(self, places: ShapePlaces, meshes: Mapping[str, MeshTriangles]) -> None:
        self._places = places
        self._numbers = [
            n for n, each in enumerate(places.shapes) if each.kind != 'mesh' or each.file in meshes
        ]
        self.shapes = [places.shapes[n] for n in self._numbers]
        boxes = [bounding_box(each, meshes.get(each.file)) for each in self.shapes]
        self._boxes = np.array(boxes).reshape(-1, 2, 3)

    def places(self, frames: Floats) -> Floats:
        """(4 m, 3) m: of each shape its middle and the ends of its three half axes; a mesh
        has the half axes of its bounding box. frames (bodies, 7): as in `ShapePlaces.poses`."""
        if not self.shapes:
            return np.zeros((0, 3))
        return half_axis_ends(self._places.poses(frames)[self._numbers], self._boxes)


Box = tuple[tuple[float, ...], tuple[float, ...]]


def bounding_box(shape: VisualShape, mesh: MeshTriangles | None = None) -> Box:
    """Middle (m) in the axes of a shape that is no capsule, and its half extents along them (m);
    a mesh with its triangles."""
    if mesh is None:
        return (0.0, 0.0, 0.0), _half_axes(shape)
    scale = np.array(shape.size)
    return tuple((scale * mesh.middle).tolist()), tuple((scale * mesh.halves).tolist())


def _half_axes(shape: VisualShape) -> tuple[float, float, float]:
    """Half of the extent of a box, a cylinder or a sphere along its x, y and z (m)."""
    if shape.kind == 'box':
        x, y, z = shape.size
        return 0.5 * x, 0.5 * y, 0.5 * z
    radius = shape.size[0]
    return radius, radius, 0.5 * shape.size[1] if shape.kind == 'cylinder' else radius


def half_axis_ends(poses: Floats, boxes: Floats) -> Floats:
    """(4 n, 3) m: middles and the ends of half axes of `boxes` (n, 2, 3) m, as of `bounding_box`;
    poses (n, 7)."""
    axes = Rotation.from_quat(poses[:, 3:]).as_matrix().transpose(0, 2, 1)
    middles = poses[:, None, :3] + boxes[:, :1] @ axes
    ends = middles + boxes[:, 1, :, None] * axes
    return np.concatenate([middles, ends], axis=1).reshape(-1, 3)


def shape_places(mechanism: Mechanism) -> ShapePlaces | None:
    """The places of all shapes of a mechanism; None if it has none."""
    number = {body.name: n for n, body in enumerate(mechanism.bodies)} | {GROUND: -1}
    found = [
        (part, number[name])
        for name, shapes in shown_parts(mechanism)
        for shape in shapes
        for part in shape.without_capsule
    ]
    if not found:
        return None
    shapes = tuple(shape for shape, _ in found)
    return ShapePlaces(
        shapes,
        np.array([body for _, body in found]),
        np.array([shape.at for shape in shapes]),
        Rotation.from_matrix(np.array([shape.turn for shape in shapes])).as_quat(),
    )

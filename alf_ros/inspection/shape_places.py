"""The shapes of a mechanism where they are drawn: in the world, with the frames of bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
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

    @cached_property
    def outlined(self) -> list[int]:
        """Numbers of the shapes that line drawings show: all but meshes, which are not read."""
        return [n for n, shape in enumerate(self.shapes) if shape.kind != 'mesh']

    def drawn(self, frames: Floats) -> Floats:
        """(4 m, 3) m: of each shape `outlined` its middle and the ends of its three half axes."""
        if not self.outlined:
            return np.zeros((0, 3))
        halves = np.array([half_axes(self.shapes[n]) for n in self.outlined])
        return half_axis_ends(self.poses(frames)[self.outlined], halves)


def half_axes(shape: VisualShape) -> tuple[float, float, float]:
    """Half of the extent of a box, a cylinder or a sphere along its x, y and z (m)."""
    if shape.kind == 'box':
        x, y, z = shape.size
        return 0.5 * x, 0.5 * y, 0.5 * z
    radius = shape.size[0]
    return radius, radius, 0.5 * shape.size[1] if shape.kind == 'cylinder' else radius


def half_axis_ends(poses: Floats, halves: Floats) -> Floats:
    """(4 n, 3) m: middles and the ends of half axes of `halves` (n, 3) m; poses (n, 7)."""
    turns = Rotation.from_quat(poses[:, 3:]).as_matrix()
    ends = poses[:, None, :3] + halves[:, :, None] * turns.transpose(0, 2, 1)
    return np.concatenate([poses[:, None, :3], ends], axis=1).reshape(-1, 3)


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

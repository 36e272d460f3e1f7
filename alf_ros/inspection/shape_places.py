"""The shapes of a mechanism where they are drawn: in the world, with the frames of bodies."""

from __future__ import annotations

from dataclasses import dataclass

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

"""Shapes that show bodies to people: boxes, cylinders, capsules, spheres and meshes.

No simulation reads them. Axes are as in URDF: cylinders and capsules lie along their z axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from urllib.parse import quote

import numpy as np

from alf_ros.arrays import Floats

PACKAGE = 'package://'


@dataclass(frozen=True, slots=True)
class VisualShape:
    """A shape with its pose in the frame of its body; of the ground in the world frame.

    kind: 'box', 'cylinder', 'capsule', 'sphere' or 'mesh'. size: of a box its edges along x, y, z
    (m); of a cylinder its radius and its length (m); of a capsule the same, without the two
    half-spheres; of a sphere its radius (m); of a mesh the factors of its x, y, z. at: its middle,
    of a mesh its origin (m). rpy: roll, pitch and yaw about fixed x, y and z (rad). color: red,
    green, blue and opacity, from 0 to 1; None: not given. file: of a mesh, an absolute path or a
    URI with `package://`.
    """

    kind: str
    size: tuple[float, ...]
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    color: tuple[float, ...] | None = None
    file: str = ''

    @property
    def turn(self) -> Floats:
        """(3, 3) its axes in columns."""
        (a, b, c), s = map(math.cos, self.rpy), [math.sin(angle) for angle in self.rpy]
        return np.array(
            [
                [b * c, s[0] * s[1] * c - a * s[2], a * s[1] * c + s[0] * s[2]],
                [b * s[2], s[0] * s[1] * s[2] + a * c, a * s[1] * s[2] - s[0] * c],
                [-s[1], s[0] * b, a * b],
            ]
        )

    @property
    def without_capsule(self) -> tuple[VisualShape, ...]:
        """The shapes to draw where there is no capsule: it is a cylinder and two spheres."""
        if self.kind != 'capsule':
            return (self,)
        radius, length = self.size
        ends = [
            tuple((np.array(self.at) + end * length * self.turn[:, 2]).tolist())
            for end in (-0.5, 0.5)
        ]
        spheres = (replace(self, kind='sphere', size=(radius,), at=end) for end in ends)
        return (replace(self, kind='cylinder'), *spheres)

    @property
    def uri(self) -> str:
        """The URI of the file of a mesh."""
        if self.file.startswith(PACKAGE):
            return self.file
        return f'file://{quote(str(PurePosixPath(self.file)))}'


def roll_pitch_yaw(turn: Floats) -> tuple[float, float, float]:
    """The angles (rad) of axes (3, 3) in columns; where roll and yaw are one, it is all roll."""
    level = math.hypot(turn[0, 0], turn[1, 0])
    pitch = math.atan2(-turn[2, 0], level)
    if level < 1e-9:
        return math.atan2(-turn[1, 2], turn[1, 1]), pitch, 0.0
    roll, yaw = math.atan2(turn[2, 1], turn[2, 2]), math.atan2(turn[1, 0], turn[0, 0])
    return roll, pitch, yaw

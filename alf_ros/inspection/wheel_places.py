"""Wheels of a mechanism as places of their bodies: of each its centre, and two places on its rim.

The two places are a right angle apart about the axle, so that c + cos φ (a - c) + sin φ (b - c) is
the rim, also in a parallel projection. The joints say where wheels are, as in `check`'s picture.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.inspection.joint_pen import JointPen
from alf_ros.mechanism import GROUND, Joint, Mechanism
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.joints import type_of


class _Nothing:
    """A canvas that draws nothing."""

    def line(self, places: Floats, **style: Any) -> None:
        """A line."""


class DrawnPosture:
    """The mechanism at q (blocks, D), m, as a `PenTarget` without a picture."""

    size = 1.0

    def __init__(self, layout: Layout, q: Floats) -> None:
        self.layout, self._q = layout, q
        self.canvas = _Nothing()

    def places_of(self, joint: Joint) -> tuple[Floats, Floats]:
        """(D,) where the parent has it, and where the child."""
        base, tip = joint.frames
        place = self.layout.place
        return (
            self.value(place(joint.parent, base.origin)),
            self.value(place(joint.child, tip.origin)),
        )

    def value(self, f: Form) -> Floats:
        """Of a form at this position."""
        return f.value(self._q)

    def local_directions(self, body: str, vectors: Floats) -> Floats:
        """Vectors (k, D) of the world in the axes of a body, or of the ground."""
        if body == GROUND:
            return vectors
        eye = np.eye(self.layout.dimension)
        axes = [self.value(self.layout.direction(body, tuple(axis))) for axis in eye.tolist()]
        return vectors @ np.array(axes).T


class _WheelPen(JointPen):
    """Keeps the wheels of a joint: body, and places (3, D) in the world."""

    def __init__(self, posture: DrawnPosture, joint: Joint) -> None:
        super().__init__(posture, joint)
        self.found: list[tuple[str, Floats]] = []

    def circle(self, at: Floats, radius: float) -> None:
        body = self.joint.child if at is self.at else self.joint.parent
        rim = abs(radius) * np.eye(2)
        self.found.append((body, at + np.vstack([np.zeros(2), rim])))

    def wheel(self, axle: Floats | None, leans: bool = False) -> None:
        R, (x, y) = self.joint.value, self.across(axle, leans)
        self.found.append((self.joint.child, self.at + R * np.array([0.0 * x, x, y])))


def wheel_places(mechanism: Mechanism, layout: Layout, q: Floats) -> list[Form]:
    """Three places for each wheel: its centre and two of its rim, fixed in its body.

    q (n,) m is a position of the mechanism, in which the two places are chosen. A wheel of several
    joints counts once.
    """
    D = layout.dimension
    posture, found = DrawnPosture(layout, q.reshape(-1, D)), dict[Any, list[Form]]()
    for joint in mechanism.joints:
        if not type_of(joint).is_round:
            continue
        pen = _WheelPen(posture, joint)
        type_of(joint).draw(pen)
        for body, places in pen.found:
            local = posture.local_directions(
                body, places - posture.value(layout.place(body, (0.0,) * D))
            )
            key = body, tuple(np.round(local[0], 9)), round(float(np.ptp(local, axis=0).max()), 9)
            found.setdefault(key, [layout.place(body, tuple(place)) for place in local.tolist()])
    return [form for forms in found.values() for form in forms]

"""The axes of the child on the parent, of which the angles of balls are made."""

from __future__ import annotations

import math

import numpy as np

from alf_ros.kernel import BallAngles
from alf_ros.mechanism import Joint
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.packing import rows_of
from alf_ros.model.constraints.row import Row, product


def ball_angles(layout: Layout) -> BallAngles:
    """The balls of a mechanism that have angles, in the order of `Mechanism.ball_angles`."""
    balls = [joint for joint in layout.mechanism.joints if joint.angles]
    rows = [row for joint in balls for row in _rows(joint, layout)]
    return BallAngles(rows_of(rows, layout)[0], np.array([joint.value for joint in balls]))


def _rows(joint: Joint, layout: Layout) -> list[Row]:
    base, tip = (np.array(frame.axes) for frame in joint.frames)
    sine, cosine = math.sin(joint.value), math.cos(joint.value)
    own = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]]) @ tip
    along = [layout.direction(joint.parent, tuple(axis)) for axis in base.tolist()]
    return [
        product('', axis, layout.direction(joint.child, tuple(direction)))
        for direction in own.tolist()
        for axis in along
    ]

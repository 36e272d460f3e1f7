"""What acts on the free axes of joints: the power of the child alone, moved along one at speed 1.

An effect on a joint coordinate x exerts F ∂x/∂q; on blocks that the child does not share, F is the
product with any velocity of the child that makes ẋ = 1.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Coordinate
from alf_ros.mechanism.natural_coordinates import TURN, Layout


def unit_motion(coordinate: Coordinate, cut: Layout, q: Floats) -> Floats:
    """(cut blocks D,) the velocity of the child that makes ẋ = 1; q (cut blocks D,)."""
    D, joint = cut.dimension, coordinate.joint
    places = q.reshape(-1, D)
    velocity = np.zeros_like(places)
    blocks = np.array(cut.of_body[joint.child])
    points = blocks[: len(cut.body[joint.child].points)]
    base, tip = joint.frames
    axis = cut.direction(joint.parent, base.axes[0 if D == 2 else 2]).value(places)
    if not coordinate.is_angle:
        velocity[points] = axis
        return velocity.ravel()
    if coordinate.freedom.on_child:
        axis = cut.direction(joint.child, tip.axes[0]).value(places)
    arms = places.copy()
    arms[points] -= cut.place(joint.child, tip.origin).value(places)
    turned = arms @ TURN.T if D == 2 else np.cross(axis, arms)
    velocity[blocks] = turned[blocks]
    return velocity.ravel()

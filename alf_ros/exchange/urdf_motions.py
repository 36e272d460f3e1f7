"""The motions of the joints of a URDF: a joint with several coordinates makes them in turn.

A `planar` joint slides along two directions in its plane and turns about its axis. A `floating`
joint slides along x, y, z, and then turns about x, y, z of the frame that has moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import FramePose

SINGLE = ('revolute', 'continuous', 'prismatic')  # along or about an axis, by one number
TYPES = (*SINGLE, 'planar', 'floating')
PART = '\0'  # between the name of a joint with several coordinates and the number of one


@dataclass(frozen=True, eq=False)
class TreeMotion:
    """A coordinate of a joint: along (`slides`) or about an axis (3,) of the child's frame. Its
    name is the joint's if the joint has one coordinate."""

    name: str
    slides: bool
    axis: Floats

    def moved(self, pose: FramePose, x: float) -> FramePose:
        """A pose after the motion by x, rad or m."""
        if x == 0.0:
            return pose
        if self.slides:
            return FramePose(pose.place(x * self.axis), pose.turn)
        turned = Rotation.from_rotvec(x * self.axis).as_matrix()
        return FramePose(pose.origin, pose.turn @ turned)


def of(name: str, kind: str, axis: Floats | None) -> list[TreeMotion]:
    """The motions of a joint of one of `TYPES`. axis: (3,) of length 1; None for `floating`."""
    if axis is None:
        axes, slides = [*np.eye(3), *np.eye(3)], [True] * 3 + [False] * 3
    elif kind in SINGLE:
        return [TreeMotion(name, kind == 'prismatic', axis)]
    else:
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        side = np.asarray(side / np.linalg.norm(side))
        axes, slides = [side, np.asarray(np.cross(axis, side)), axis], [True, True, False]
    return [
        TreeMotion(f'{name}{PART}{n}', *each)
        for n, each in enumerate(zip(slides, axes, strict=True))
    ]

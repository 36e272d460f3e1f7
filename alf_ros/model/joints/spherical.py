"""`spherical`: a ball. One place of both bodies; they turn in every way.

It may stand for three revolutes in a row, as URDF writes a ball. Then it keeps their names and
angles, which `joint_states` tell; the links between have no mass and are no bodies.
"""

import math

import numpy as np

from alf_ros.mechanism import Joint
from alf_ros.model.joints.contract import ANGLES, AT, Given, JointType, Pen, at_a_point

_RIGHT = 1e-9  # cosine between axes at right angles


def _read(given: Given) -> Joint:
    if not given.has('angles'):
        return at_a_point(given)
    axes = given.named_directions('angles')
    first, middle, last = axes.values()
    if max(abs(first @ middle), abs(middle @ last)) > _RIGHT:
        raise given.error('angles', 'each axis is at a right angle to the next')
    tilt = math.atan2(np.cross(first, last) @ middle, first @ last)
    frame = np.array([middle, np.cross(first, middle), first])
    return at_a_point(given, frame, value=tilt, angles=tuple(axes))


def _draw(pen: Pen) -> None:
    pen.dot('ink', 6)


SPATIAL = JointType(
    keys=(AT,),
    read=_read,
    rows=lambda frames: frames.coincident(),
    draw=_draw,
    listed=110,
    optional=(ANGLES,),
    shares_point=True,
    holds_axis=False,
    axes=0,
    other_names=('ball',),
)

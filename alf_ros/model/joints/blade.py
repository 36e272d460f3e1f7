"""`blade`: a knife edge on the ground, or a wheel that does not slip aside.

The child's place of the joint has no velocity across the child's x axis, turned by `angle` if the
file says so. A row of velocities, which binds no position.
"""

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints import auxiliary
from alf_ros.model.constraints.row import Row, motion
from alf_ros.model.joints.contract import AT, AXIS, Frames, Given, JointType, Key, Pen, at_a_point


def _read(given: Given) -> Joint:
    angle = given.motion('angle')
    return at_a_point(given, motion=angle, turning=True, auxiliary=('',) if angle else ())


def _rows(frames: Frames) -> list[Row]:
    joint, layout = frames.joint, frames.layout
    across, turning = frames.axis(1, 1), list[Row]()
    if joint.motion:
        across, turning = auxiliary.turned(joint.name, frames.axis(1, 0), across, layout)
    place = layout.place(joint.child, joint.frames[1].origin)
    return [*turning, motion(joint.name, (across, place))]


def _block(joint: Joint, _: str, layout: Layout, places: Floats) -> Floats:
    """The direction across the blade."""
    frames = Frames(joint, layout)
    X, Y = frames.axis(1, 0).value(places), frames.axis(1, 1).value(places)
    c, s = places[layout.of_prescribed[joint.name]][:2]
    return np.asarray(c * Y - s * X)


def _draw(pen: Pen) -> None:
    pen.bar(pen.own[0], 3.5 * pen.size, 3.0)


PLANAR = JointType(
    keys=(AT, AXIS),
    optional=(Key('angle', 'number', 'by how much it is turned on its body: rad, of t'),),
    read=_read,
    rows=_rows,
    draw=_draw,
    listed=80,
    on_ground=True,
    block=_block,
)

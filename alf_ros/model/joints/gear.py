"""`gear`: two wheels with teeth, whose centres are held by other joints.

R ω_parent + r ω_child = (R + r) × the rate of the line of centres: a row of velocities, which can
be integrated, so that the wheels stay in mesh when a body is placed.
"""

from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.joints.contract import (
    CENTRES,
    INTERNAL,
    RADII,
    Frames,
    JointType,
    Pen,
    rolling,
    wheels,
)


def _slip(joint: Joint, layout: Layout, before: Floats, after: Floats) -> float:
    gap, R, r = Frames(joint, layout).gap, joint.of_parent, joint.value
    parent, child = (
        wheels.turned(layout, body, before, after) for body in (joint.parent, joint.child)
    )
    line = wheels.angle_between(gap.value(before), gap.value(after))
    return R * parent + r * child - (R + r) * line


def _draw(pen: Pen) -> None:
    pen.circle(pen.at, pen.joint.value)
    pen.circle(pen.there, pen.joint.of_parent)


PLANAR = JointType(
    keys=(CENTRES, RADII),
    optional=(INTERNAL,),
    read=wheels.pair,
    rows=lambda frames: [rolling.of_gears(frames.joint, frames.layout)],
    draw=_draw,
    listed=50,
    is_round=True,
    integrable=True,
    slip=_slip,
)

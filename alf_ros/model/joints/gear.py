"""`gear`: two wheels with teeth, whose centres are held by other joints.

R ω_parent + r ω_child = (R + r) × the rate of the line of centres: a row of velocities with an
integral, so that the wheels stay in mesh when a body is placed.
"""

from alf_ros.model.joints.contract import (
    CENTRES,
    INTERNAL,
    RADII,
    JointType,
    Pen,
    rolling,
    wheels,
)


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
    integral=rolling.integral_of_gears,
    teeth=True,
)

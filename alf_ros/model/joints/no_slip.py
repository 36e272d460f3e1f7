"""`no_slip`: a wheel on a line of the ground, in space a ball on a plane of it, that rolls.

It touches, and what touches has the velocity of the ground there, of a belt or of a turntable:
rows of velocities. In the plane they bind positions too.
"""

from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import (
    AT,
    ON,
    RADIUS,
    Frames,
    JointType,
    Pen,
    rolling,
    wheels,
)


def _rows_planar(frames: Frames) -> list[Row]:
    touch = frames.product('touch', frames.axis(0, 1), frames.gap, frames.joint.value)
    return [touch, rolling.on_a_line(frames.joint, frames.layout)]


def _rows(frames: Frames) -> list[Row]:
    touch = frames.product('touch', frames.axis(0, 2), frames.gap, frames.joint.value)
    return [touch, *rolling.on_a_plane(frames.joint, frames.layout)]


def _draw_planar(pen: Pen) -> None:
    pen.wheel(None)


def _draw(pen: Pen) -> None:
    pen.wheel(pen.stiffest())


PLANAR = JointType(
    keys=(AT, ON, RADIUS),
    read=wheels.wheel,
    rows=_rows_planar,
    draw=_draw_planar,
    listed=90,
    on_ground=True,
    is_round=True,
    integral=rolling.integral_on_a_line,
)
SPATIAL = JointType(
    keys=(AT, ON, RADIUS),
    read=wheels.wheel,
    rows=_rows,
    draw=_draw,
    listed=200,
    on_ground=True,
    is_round=True,
)

"""`rolling`: two wheels that touch and roll on each other, as gears that stay in touch.

½ (|gap|² - (R + r)²) / |R + r| = 0, and the row of a gear.
"""

from alf_ros.model.constraints.row import Row, product, scaled
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


def _rows(frames: Frames) -> list[Row]:
    joint, gap = frames.joint, frames.gap
    apart = joint.of_parent + joint.value
    touch = product(frames.name('touch'), gap, gap, apart**2)
    touch = scaled(0.5 / abs(apart), touch)  # so it is in m
    return [touch, rolling.of_gears(joint, frames.layout)]


def _draw(pen: Pen) -> None:
    pen.circle(pen.at, pen.joint.value)
    pen.circle(pen.there, pen.joint.of_parent)


PLANAR = JointType(
    keys=(CENTRES, RADII),
    optional=(INTERNAL,),
    read=wheels.pair,
    rows=_rows,
    draw=_draw,
    listed=60,
    is_round=True,
    integral=rolling.integral_of_gears,
)

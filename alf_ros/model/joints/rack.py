"""`rack`: a wheel with teeth on a straight line of its parent, which may move.

d/dt (x · gap) + R (ω - ω_line) = 0, gap from the line to the centre: a row of velocities with an
integral. Other joints keep the centre at the distance R from the line.
"""

import numpy as np

from alf_ros.model.joints.contract import (
    AT,
    ON,
    RADIUS,
    JointType,
    Pen,
    rolling,
    wheels,
)


def _draw(pen: Pen) -> None:
    radius = pen.joint.value
    pen.circle(pen.at, radius)
    low = pen.at - radius * pen.axes[1]
    pen.line(np.array([low - 1.5 * radius * pen.along, low + 1.5 * radius * pen.along]), '-.')


PLANAR = JointType(
    keys=(AT, ON, RADIUS),
    read=wheels.on_a_rack,
    rows=lambda frames: [rolling.on_a_line(frames.joint, frames.layout)],
    draw=_draw,
    listed=70,
    is_round=True,
    integral=rolling.integral_on_a_line,
    teeth=True,
)

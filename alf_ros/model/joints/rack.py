"""`rack`: a wheel with teeth on a straight line of its parent, which may move.

x · (v - v_line) + R ω = 0: a row of velocities, which can be integrated.
"""

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint
from alf_ros.mechanism.natural_coordinates import TURN, Layout
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


def _slip(joint: Joint, layout: Layout, before: Floats, after: Floats) -> float:
    frames = Frames(joint, layout)
    x, gap = frames.axis(0, 0), frames.gap
    parent, child = (
        wheels.turned(layout, body, before, after) for body in (joint.parent, joint.child)
    )
    along, apart = [], []
    for q in (before, after):
        along.append(x.value(q) @ gap.value(q))
        apart.append((TURN @ x.value(q)) @ gap.value(q))
    return float(along[1] - along[0] - 0.5 * sum(apart) * parent + joint.value * child)


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
    integrable=True,
    slip=_slip,
)

"""`screw`: a nut on a thread. One axis of both bodies; along it the child moves as it turns.

s = l θ, l = pitch / 2π (m/rad), s the place of the child's origin on the axis, θ its angle about
the axis, both from the drawing and counted over all turns. A positive pitch is a right-handed
thread: turning right-handed about the axis goes along it.

A row of second order covers one turn only, so the last row binds velocities: ṡ - l θ̇ = 0 with ṡ =
d/dt (z · gap) and θ̇ = u̇_x · u_y of the child minus the rate of the parent, u_x and u_y their
axes across z. Its integral is s - l θ, which the kernel keeps at its value.
"""

import math

import numpy as np

from alf_ros.mechanism import GROUND, Joint
from alf_ros.model.constraints.row import Row, motion, product
from alf_ros.model.constraints.velocity_integral import IntegralTerm, angle_between
from alf_ros.model.joints.contract import (
    ANGLE,
    AT,
    AXIS,
    Frames,
    Given,
    JointType,
    Key,
    Pen,
    UrdfJoint,
    Z,
    at_a_point,
)

_TURNS, _POINTS = 2.5, 61  # of the symbol


def _read(given: Given) -> Joint:
    pitch = given.number('pitch')
    if pitch == 0.0:
        raise given.error('pitch', 'a thread without pitch', expected='m per turn, not zero')
    return at_a_point(given, value=pitch / (2.0 * math.pi))


def _rows(frames: Frames) -> list[Row]:
    joint, z, lead = frames.joint, frames.axis(0, 2), frames.joint.value
    pairs = [(z, frames.gap), (frames.gap, z)]
    for side, body, factor in ((1, joint.child, -lead), (0, joint.parent, lead)):
        if body != GROUND:
            pairs.append((frames.axis(side, 1).times(factor), frames.axis(side, 0)))
    return [*frames.aside(), *frames.parallel(), motion(joint.name, *pairs)]


def _integral(frames: Frames) -> list[IntegralTerm]:
    x, y, z = (frames.axis(0, n) for n in range(3))
    turned = angle_between(-frames.joint.value, x, y, frames.axis(1, 0))
    return [IntegralTerm(1.0, (product('', z, frames.gap),)), turned]


def _draw(pen: Pen) -> None:
    """A rod, and the thread around it, which rises as the thread of the joint."""
    s, across = pen.size, np.cross(pen.along, pen.side)
    part = np.linspace(-1.0, 1.0, _POINTS)[:, None]
    angle = math.copysign(_TURNS * math.pi, pen.joint.value) * part
    thread = 0.9 * s * (np.cos(angle) * pen.side + np.sin(angle) * across)
    pen.bar(pen.along, 4.0 * s)
    pen.line(pen.at + 2.4 * s * part * pen.along + thread, width=1.3)
    pen.dot('white', 4)


SPATIAL = JointType(
    keys=(
        AT,
        AXIS,
        Key('pitch', 'number', 'advance per turn (m), negative for a left-handed thread'),
    ),
    read=_read,
    rows=_rows,
    draw=_draw,
    listed=145,
    freedoms=(ANGLE,),
    integral=_integral,
    teeth=True,
    urdf=(UrdfJoint('', 'continuous', Z), UrdfJoint('_length', 'prismatic', Z, mimics=True)),
)

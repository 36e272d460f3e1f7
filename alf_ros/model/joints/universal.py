"""`universal`: a cross of two perpendicular axes, the first on the parent, the other on the child.

One place of both bodies, and z_parent · x_child = 0. Its angles are about both axes of the cross.
"""

import numpy as np

from alf_ros.mechanism import Freedom, Joint
from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import (
    AT,
    Frames,
    Given,
    JointType,
    Key,
    Pen,
    UrdfJoint,
    X,
    Z,
    at_a_point,
)


def _read(given: Given) -> Joint:
    given.point('at')
    z, x = given.directions('axes')
    if abs(z @ x) > 1e-9:
        raise given.error('axes', 'the axes of a universal joint are perpendicular')
    return at_a_point(given, np.array([x, np.cross(z, x), z]))


def _rows(frames: Frames) -> list[Row]:
    return [*frames.coincident(), frames.product('cross', frames.axis(0, 2), frames.axis(1, 0))]


def _draw(pen: Pen) -> None:
    pen.bar(pen.along, 3.0 * pen.size)
    pen.bar(pen.own[0], 2.2 * pen.size)
    pen.dot('pale', 6)


SPATIAL = JointType(
    keys=(AT, Key('axes', 'axes', 'direction on the parent, on the child')),
    read=_read,
    rows=_rows,
    draw=_draw,
    listed=130,
    freedoms=(
        Freedom(True, 'first', alone=False),
        Freedom(True, 'second', on_child=True, alone=False),
    ),
    shares_point=True,
    axes=2,
    other_names=('revolute2',),
    urdf=(UrdfJoint('_first', 'continuous', Z), UrdfJoint('_second', 'continuous', X)),
)

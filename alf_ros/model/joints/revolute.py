"""`revolute`: a pin. One place of both bodies, in space also one axis, about which they turn."""

from alf_ros.mechanism import Joint
from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import (
    ANGLE,
    AT,
    AXIS,
    Frames,
    Given,
    JointType,
    Pen,
    UrdfJoint,
    Z,
    at_a_point,
)

_URDF = (UrdfJoint('', 'continuous', Z),)


def _read_planar(given: Given) -> Joint:
    """Both bodies have the point: in the plane there is no other place for a pin."""
    point, sides = given.point('at'), (given.parent, given.child)
    if not all(given.carries(body, point) for body in sides):
        for body in sides:
            given.check_carries('at', point, body)
    return at_a_point(given)


def _draw_planar(pen: Pen) -> None:
    pen.dot('white', 7)


def _rows(frames: Frames) -> list[Row]:
    return frames.coincident() + frames.parallel()


def _draw(pen: Pen) -> None:
    pen.bar(pen.along, 2.2 * pen.size)
    pen.dot('white', 6)


PLANAR = JointType(
    keys=(AT,),
    read=_read_planar,
    rows=lambda frames: frames.coincident(),
    draw=_draw_planar,
    listed=10,
    freedoms=(ANGLE,),
    shares_point=True,
    urdf=_URDF,
)
SPATIAL = JointType(
    keys=(AT, AXIS),
    read=at_a_point,
    rows=_rows,
    draw=_draw,
    listed=120,
    freedoms=(ANGLE,),
    shares_point=True,
    axes=1,
    other_names=('continuous',),
    urdf=_URDF,
)

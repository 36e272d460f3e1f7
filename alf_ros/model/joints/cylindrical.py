"""`cylindrical`: a rod in a sleeve. One axis of both bodies, about and along which they move."""

from alf_ros.mechanism import Freedom
from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import (
    AT,
    AXIS,
    Frames,
    JointType,
    Pen,
    UrdfJoint,
    Z,
    at_a_point,
)


def _rows(frames: Frames) -> list[Row]:
    return frames.aside() + frames.parallel()


def _draw(pen: Pen) -> None:
    s = pen.size
    pen.bar(pen.along, 3.0 * s)
    pen.box(pen.along, pen.side, 1.6 * s, 0.8 * s)
    pen.dot('white', 6)


SPATIAL = JointType(
    keys=(AT, AXIS),
    read=at_a_point,
    rows=_rows,
    draw=_draw,
    listed=140,
    freedoms=(Freedom(True, 'angle'), Freedom(False, 'length')),
    axes=1,
    urdf=(UrdfJoint('_length', 'prismatic', Z), UrdfJoint('_angle', 'continuous', Z)),
)

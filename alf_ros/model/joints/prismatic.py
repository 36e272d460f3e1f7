"""`prismatic`: a slide. The bodies move along one axis of both and do not turn."""

from alf_ros.mechanism import GROUND
from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import (
    AT,
    AXIS,
    LENGTH,
    Frames,
    JointType,
    Pen,
    UrdfJoint,
    X,
    Z,
    at_a_point,
)


def _rows_planar(frames: Frames) -> list[Row]:
    return [
        frames.product('side', frames.axis(0, 1), frames.gap),
        frames.product('turn', frames.axis(0, 1), frames.axis(1, 0)),
    ]


def _rows(frames: Frames) -> list[Row]:
    turn = frames.product('turn', frames.axis(0, 0), frames.axis(1, 1))
    return [*frames.aside(), *frames.parallel(), turn]


def _draw(pen: Pen) -> None:
    s = pen.size
    if pen.joint.parent == GROUND:
        pen.rail(pen.at - 0.9 * s * pen.side, pen.along, pen.side, 5.0 * s)
    else:
        pen.bar(pen.along, 5.0 * s)
    pen.box(pen.along, pen.side, 1.8 * s, 0.9 * s)


PLANAR = JointType(
    keys=(AT, AXIS),
    read=at_a_point,
    rows=_rows_planar,
    draw=_draw,
    listed=30,
    freedoms=(LENGTH,),
    urdf=(UrdfJoint('', 'prismatic', X),),
)
SPATIAL = JointType(
    keys=(AT, AXIS),
    read=at_a_point,
    rows=_rows,
    draw=_draw,
    listed=150,
    freedoms=(LENGTH,),
    axes=1,
    urdf=(UrdfJoint('', 'prismatic', Z),),
)

"""`slider`: a point of a body on a line of the ground. The body may turn."""

from alf_ros.mechanism import GROUND, Joint
from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import LENGTH, ON, Frames, Given, JointType, Key, Pen


def _read(given: Given) -> Joint:
    point = given.point('point')
    if given.is_fixed(point):
        raise given.error('point', 'a fixed point cannot slide', value=point)
    given.find_body('point', point)
    line = given.surface('on', may_move=False)
    return given.joint(
        given.frame_at(GROUND, line.through, given.axes(line.along)),
        given.frame(given.child, point),
    )


def _rows(frames: Frames) -> list[Row]:
    return [frames.product('', frames.axis(0, 1), frames.gap)]


def _draw(pen: Pen) -> None:
    s, along = pen.size, pen.along
    rail = pen.there + along * ((pen.at - pen.there) @ along)
    pen.rail(rail - 0.9 * s * pen.side, along, pen.side, 5.0 * s)
    pen.box(along, pen.side, 1.8 * s, 0.9 * s)
    pen.dot('white', 5)


PLANAR = JointType(
    keys=(Key('point', 'point', 'point that slides'), ON),
    read=_read,
    rows=_rows,
    draw=_draw,
    listed=20,
    freedoms=(LENGTH,),
    finds_body=True,
    urdf_rail=True,
)

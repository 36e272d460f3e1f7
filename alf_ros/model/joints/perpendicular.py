"""`perpendicular`: an axis of the parent and one of the child stay at right angles."""

from alf_ros.mechanism import Joint
from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import Frames, Given, JointType, Key, Pen


def _read(given: Given) -> Joint:
    z, other = given.directions('axes')
    child = given.body(given.child)
    assert child is not None  # the ground is never the child
    place = given.place(child.points[0])
    return given.joint(
        given.frame_at(given.parent, place, given.axes(z)),
        given.frame_at(given.child, place, given.axes(other)),
    )


def _rows(frames: Frames) -> list[Row]:
    return [frames.product('', frames.axis(0, 2), frames.axis(1, 2))]


def _draw(pen: Pen) -> None:
    """It has no place."""


SPATIAL = JointType(
    keys=(Key('axes', 'axes', 'direction on the parent, on the child'),),
    read=_read,
    rows=_rows,
    draw=_draw,
    listed=180,
)

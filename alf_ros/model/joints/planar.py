"""`planar`: two planes on each other.

The child moves in the plane across the axis and turns in it. Its three freedoms have no
coordinates.
"""

from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import AT, AXIS, Frames, JointType, Pen, at_a_point


def _rows(frames: Frames) -> list[Row]:
    return [*frames.parallel(), frames.product('touch', frames.axis(0, 2), frames.gap)]


def _draw(pen: Pen) -> None:
    s = pen.size
    pen.box(pen.axes[0], pen.axes[1], 4.0 * s, 4.0 * s)
    pen.bar(pen.along, 1.5 * s)


SPATIAL = JointType(
    keys=(AT, AXIS),
    read=at_a_point,
    rows=_rows,
    draw=_draw,
    listed=160,
    axes=1,
)

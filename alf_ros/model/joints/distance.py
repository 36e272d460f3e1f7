"""`distance`: a bar without mass between a point of the parent and one of the child.

½ (|gap|² - length²) = 0.
"""

import numpy as np

from alf_ros import columns
from alf_ros.mechanism import Joint
from alf_ros.model.constraints.row import Row, product, scaled
from alf_ros.model.joints.contract import Frames, Given, JointType, Key, Pen


def _read(given: Given) -> Joint:
    ends = given.points('points')
    for n, (point, body) in enumerate(zip(ends, (given.parent, given.child), strict=True)):
        given.check_carries('points', point, body, n)
    length = columns.distance(*(given.place(point) for point in ends))
    if given.has('length'):
        length = given.number('length')
    if not length > 0.0:
        raise given.error('', 'a bar without length', expected='m, more than zero')
    first, second = ends
    return given.joint(
        given.frame(given.parent, first), given.frame(given.child, second), value=length
    )


def _rows(frames: Frames) -> list[Row]:
    gap, length = frames.gap, frames.joint.value
    return [scaled(0.5, product(frames.name(), gap, gap, length**2))]


def _draw(pen: Pen) -> None:
    ends = np.array([pen.there, pen.at])
    pen.line(ends, '--', 1.2)
    pen.dots(ends)


SPATIAL = JointType(
    keys=(Key('points', 'points', 'point of the parent, of the child'),),
    optional=(Key('length', 'number', 'length of the bar (m); as drawn if absent'),),
    read=_read,
    rows=_rows,
    draw=_draw,
    listed=190,
    holds_axis=False,
    drawn_length=True,
)

"""`weld`: two bodies are one."""

from alf_ros.model.constraints.row import Row
from alf_ros.model.joints.contract import AT, Frames, JointType, Pen, at_a_point


def _rows_planar(frames: Frames) -> list[Row]:
    return [
        *frames.coincident(),
        frames.product('turn', frames.axis(0, 1), frames.axis(1, 0)),
    ]


def _rows(frames: Frames) -> list[Row]:
    turn = frames.product('turn', frames.axis(0, 0), frames.axis(1, 1))
    return [*frames.coincident(), *frames.parallel(), turn]


def _draw(pen: Pen) -> None:
    pen.square()


PLANAR = JointType(
    keys=(AT,),
    read=at_a_point,
    rows=_rows_planar,
    draw=_draw,
    listed=40,
    shares_point=True,
    urdf=(),
)
SPATIAL = JointType(
    keys=(AT,),
    read=at_a_point,
    rows=_rows,
    draw=_draw,
    listed=170,
    shares_point=True,
    axes=0,
    other_names=('fixed',),
    urdf=(),
)

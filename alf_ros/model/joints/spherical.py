"""`spherical`: a ball. One place of both bodies; they turn in every way."""

from alf_ros.model.joints.contract import AT, JointType, Pen, at_a_point


def _draw(pen: Pen) -> None:
    pen.dot('ink', 6)


SPATIAL = JointType(
    keys=(AT,),
    read=at_a_point,
    rows=lambda frames: frames.coincident(),
    draw=_draw,
    listed=110,
    shares_point=True,
    holds_axis=False,
    axes=0,
    other_names=('ball',),
)

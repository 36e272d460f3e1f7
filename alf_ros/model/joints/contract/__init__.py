"""Contract of a joint type: its keys, freedoms, constraint rows, symbol and meaning elsewhere.

The reader, the schema, the rows, coordinates, reactions, pictures and exporters ask the type;
these modules do not know its name. Protocols define the data that a type receives: `Given`, the
joint in a file, and `Pen`, which draws it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from alf_ros.arrays import Floats
from alf_ros.mechanism import Freedom, Joint, Numbers
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.row import Row
from alf_ros.model.constraints.velocity_integral import IntegralTerm
from alf_ros.model.joints.contract.frames import Frames
from alf_ros.model.joints.contract.given import Given, Surface, at_a_point
from alf_ros.model.joints.contract.pen import Pen

__all__ = [
    'ANGLE',
    'ANGLES',
    'ANYWHERE',
    'AT',
    'AXIS',
    'CENTRES',
    'INTERNAL',
    'LENGTH',
    'ON',
    'RADII',
    'RADIUS',
    'X',
    'Z',
    'Frames',
    'Given',
    'JointType',
    'Key',
    'Pen',
    'Surface',
    'UrdfJoint',
    'at_a_point',
]

X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
ANGLE, LENGTH = Freedom(True), Freedom(False)
ANYWHERE = 1000  # behind the types that have a place of their own in lists


class Key(NamedTuple):
    """A key of a joint in a mechanism file: of what shape its value is (`scene.json_schema`), and
    what it means, with its unit."""

    name: str
    shape: str
    doc: str


AT = Key('at', 'point', 'point where it is')
AXIS = Key('axis', 'axis', 'direction: numbers of any length, or a vector')
ANGLES = Key(
    'angles',
    'three axes',
    'of the row of revolutes that it stands for: name and direction of each axis, at a right '
    'angle to the next',
)
ON = Key('on', 'on', 'line, or plane, on which it moves')
RADIUS = Key('radius', 'number', 'radius of the wheel (m)')
CENTRES = Key('centres', 'points', 'centre of the parent, of the child')
RADII = Key('radii', 'numbers', 'pitch radius of the parent, of the child (m)')
INTERNAL = Key('internal', 'boolean', 'one wheel inside the other; false if absent')


class UrdfJoint(NamedTuple):
    """One joint of the row of URDF joints that a joint is.

    suffix: of its name, after the name of the joint; `type` and `axis` (3,) as URDF has them, in
    the joint's frame. mimics: its position is `value` times the position of the joint of the same
    name.
    """

    suffix: str
    type: str
    axis: Numbers
    mimics: bool = False


@dataclass(frozen=True)
class JointType:
    """A type of joint in the plane or in space.

    keys: required keys of a file in addition to `type` and `between`; `optional`: optional keys.
    read: makes the joint from a file.
    rows: the constraint rows, in order; shared points and vectors need no rows.
    draw: its symbol.
    listed: its place in lists of types.
    freedoms: the joint coordinates that it has.
    on_ground: its parent is the ground. finds_body: `between` may be absent.
    shares_point: a point that both bodies carry is one point of both.
    holds_axis: it needs an orientation of its bodies.
    drawn_length: `value` is a length that a drawing may have slightly wrong.
    is_round: `value` and `of_parent` are radii about the origins of the frames.
    integral: of its row of velocities the sum that stays constant, m; so the joint binds positions
      too. None if its rows bind positions anyway, or velocities only.
    teeth: the sum also stays constant where a body is placed. `value` is then m/rad.
    block: where its auxiliary block with this suffix is at q (blocks, D).
    axes: the number of its axes in other formats; None if they have no such type. `other_names`:
      its other names in URDF and SDF.
    urdf: its URDF joints; None if URDF has no equivalent. urdf_rail: it is a `prismatic` joint of
      the ground with a link of its own, because the sliding part may turn as well.
    """

    keys: tuple[Key, ...]
    read: Callable[[Given], Joint]
    rows: Callable[[Frames], list[Row]]
    draw: Callable[[Pen], None]
    listed: int = ANYWHERE
    optional: tuple[Key, ...] = ()
    freedoms: tuple[Freedom, ...] = ()
    on_ground: bool = False
    finds_body: bool = False
    shares_point: bool = False
    holds_axis: bool = True
    drawn_length: bool = False
    is_round: bool = False
    integral: Callable[[Frames], list[IntegralTerm]] | None = None
    teeth: bool = False
    block: Callable[[Joint, str, Layout, Floats], Floats] | None = None
    axes: int | None = None
    other_names: tuple[str, ...] = ()
    urdf: tuple[UrdfJoint, ...] | None = None
    urdf_rail: bool = False

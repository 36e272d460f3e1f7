"""A robot as other formats describe it: rigid parts, connections between them, actuators.

All places and directions are in the world frame, as drawn.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import xml_file
from alf_ros.exchange.import_report import LeftOut
from alf_ros.mechanism import VisualShape
from alf_ros.model import joints

GROUND = '\0ground'  # the name of the ground among parts: no body of a file can have it
_OPEN = 1e-6  # of the robot's size: how far the two ends of a loop may be apart as drawn

# the types of joints that other formats have, by the number of axes that each needs
AXES = {kind: each.axes for kind, each in joints.types(3).items() if each.axes is not None}
# The type of each name that other formats have for it.
TYPES = {kind: kind for kind in AXES} | {
    other: kind for kind in AXES for other in joints.types(3)[kind].other_names
}


@dataclass(frozen=True)
class FramePose:
    """A frame: `origin` (3,) m, `turn` (3, 3) whose columns are its axes."""

    origin: Floats
    turn: Floats

    def __matmul__(self, other: FramePose) -> FramePose:
        return FramePose(self.place(other.origin), self.turn @ other.turn)

    @property
    def inverse(self) -> FramePose:
        """The outer frame in this one."""
        return FramePose(-self.turn.T @ self.origin, self.turn.T)

    def place(self, inner: Sequence[float] | Floats) -> Floats:
        """A place of this frame in the outer one."""
        return self.origin + self.turn @ np.asarray(inner, dtype=float)


STILL = FramePose(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class RobotPart:
    """A rigid body: origin of its frame (m), mass (kg), com (m), inertia (3, 3) there, kg m^2.

    at: the element of XML that has its mass. links: of several that are fixed together.
    """

    name: str
    origin: Floats
    mass: float
    com: Floats
    inertia: Floats
    at: ElementTree.Element | None = None
    links: tuple[RobotPart, ...] = ()


@dataclass(frozen=True)
class AxisForces:
    """Forces on one of the two angles of a universal joint, as in `Connection`."""

    limits: tuple[float, float] | None = None
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    friction: float = 0.0


@dataclass(frozen=True)
class Connection:
    """A joint at `place`, with its unit axes; `AXES` gives their number.

    Forces on its coordinate, whose value as drawn is `drawn`: viscous `damping`, a spring of
    `stiffness` that rests at `rest`, dry `friction`; `limits` of the coordinate; the inertia
    `armature` of a rotor. rad or m, N m or N, kg m^2 or kg. pitch: of a screw, m per turn.
    start: of a `distance`, the place (3,) on the parent, at `length` (m) from the child's.
    angles: of a ball that stands for three revolutes, the name of each and its unit axis.
    of_axes: forces of a universal joint, for each of its axes.
    """

    name: str
    kind: str
    parent: str
    child: str
    place: Floats
    axes: tuple[Floats, ...] = ()
    drawn: float = 0.0
    limits: tuple[float, float] | None = None
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    pitch: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    start: Floats | None = None
    length: float = 0.0
    angles: tuple[tuple[str, Floats], ...] = ()
    of_axes: tuple[AxisForces, ...] = ()

    def coordinates(self) -> Iterator[tuple[str, Connection]]:
        """The suffix of each coordinate on which forces act, and the connection as if it had this
        one alone."""
        if not self.of_axes:
            yield '', self
            return
        freedoms = joints.types(3)[self.kind].freedoms
        for freedom, forces in zip(freedoms, self.of_axes, strict=True):
            suffix = f'_{freedom.suffix}'
            yield suffix, replace(self, name=self.name + suffix, of_axes=(), **vars(forces))


@dataclass(frozen=True)
class Actuator:
    """Drive force on a joint: effort + k_p (position - x) + k_v (velocity - ẋ), `limit` at most;
    or on a tendon, if `on_tendon`.

    The position is None where there is no gain k_p; positions count as in the source.
    """

    name: str
    joint: str
    effort: float = 0.0
    position: float | None = None
    position_gain: float = 0.0
    velocity: float | None = None
    velocity_gain: float = 0.0
    limit: float | None = None
    on_tendon: bool = False


@dataclass(frozen=True, eq=False)
class Tendon:
    """A length over joints, each with a factor, or over places of parts, each with a weight.

    path: parts with places (3,) as drawn, m; weights: from each place to the next. On the length
    act a spring of `stiffness` outside the interval `rest`, viscous `damping`, dry `friction`, and
    `limits`; as the source counts it, which has the sum over joints at `drawn`. m, N; of joints
    per unit of the length. armature: inertia of a rotor that turns with a tendon
    over joints.
    """

    name: str
    joints: Mapping[str, float] = field(default_factory=dict)
    path: Sequence[tuple[str, Floats]] = ()
    weights: Sequence[float] = ()
    drawn: float = 0.0
    stiffness: float = 0.0
    rest: tuple[float, float] = (0.0, 0.0)
    damping: float = 0.0
    friction: float = 0.0
    limits: tuple[float, float] | None = None
    armature: float = 0.0


@dataclass(frozen=True)
class Coupled:
    """Joints by name, each with a factor: Σ factor · coordinate stays what it is as drawn."""

    name: str
    of: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class FixedPlane:
    """A plane that does not move: through (3,) on it, m; normal (3,), of length 1, to its free
    side."""

    through: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class GroundTouch:
    """A ball of a part that touches a plane, or a point if its radius is 0.

    centre (3,) as drawn, m. friction: the coefficient between them. turning: whether the source
    has friction against spin and roll as well. axle (3,) as drawn: a circle about it instead.
    """

    name: str
    part: str
    centre: Floats
    radius: float
    plane: FixedPlane
    friction: float
    turning: bool = False
    axle: Floats | None = None

    @property
    def depth(self) -> float:
        """In the plane as drawn, m; negative above it."""
        across = 0.0 if self.axle is None else float(self.plane.normal @ self.axle)
        height = float(self.plane.normal @ (self.centre - self.plane.through))
        return self.radius * float(np.sqrt(max(0.0, 1.0 - across**2))) - height


@dataclass(frozen=True, eq=False)
class Collider:
    """A shape of a part with which the part touches others, placed as drawn; None: of a kind that
    no shape here has, or unusable, as `element` says: its place and text in the file. friction:
    coefficient, None: not given; `across` its direction another one if that differs. left_out:
    the rest of its surface, by the kinds of `import_report`. noted: names of the kind `gazebo`,
    which are listed unless it touches something.
    """

    name: str
    part: str
    shape: VisualShape | None
    friction: float | None = None
    across: float | None = None
    left_out: tuple[str, ...] = ()
    element: str = ''
    noted: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class BodyVelocity:
    """Velocity `linear` (3,) m/s of the place (3,) m of a part, `angular` (3,) rad/s, world."""

    place: Floats
    linear: Floats
    angular: Floats

    def at(self, place: Floats) -> Floats:
        """(3,) m/s, of another place (3,) m of the part."""
        return self.linear + np.cross(self.angular, place - self.place)


@dataclass(frozen=True, eq=False)
class Lift:
    """A force (3,) N, constant in the world, at the place (3,) m of a part as drawn."""

    force: Floats
    place: Floats


@dataclass
class Robot:
    """Parts and connections; `left_out` says, by kind, what of the source is not among them.

    still: what to do if nothing can move. shapes: with their poses in the world, each after the
    part, or the ground, that it shows. planes: fixed ones, each with its coefficient of friction
    if the file has one. touches: what of the robot touches planes. velocities: of the parts that
    move at the start. lifts: forces on parts that compensate gravity. places:
    by connection the element of XML that has it.
    """

    name: str
    file: str
    gravity: tuple[float, ...]
    still: str = ''
    parts: list[RobotPart] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    actuators: list[Actuator] = field(default_factory=list)
    tendons: list[Tendon] = field(default_factory=list)
    couplings: list[Coupled] = field(default_factory=list)
    shapes: list[tuple[str, VisualShape]] = field(default_factory=list)
    colliders: list[Collider] = field(default_factory=list)
    planes: list[tuple[FixedPlane, float | None]] = field(default_factory=list)
    touches: list[GroundTouch] = field(default_factory=list)
    velocities: dict[str, BodyVelocity] = field(default_factory=dict)
    lifts: dict[str, Lift] = field(default_factory=dict)
    places: dict[str, ElementTree.Element | None] = field(default_factory=dict)
    left_out: LeftOut = field(default_factory=LeftOut)

    @property
    def size(self) -> float:
        """The largest coordinate of a joint or a part as drawn, m."""
        places = [*(c.place for c in self.connections), *(part.origin for part in self.parts)]
        return max((float(np.abs(place).max()) for place in places), default=0.0)

    def leave(self, kind: str, name: str) -> None:
        """Note that something of `name` does not come along; `kind` is one of `report`."""
        self.left_out.add(kind, name.replace(GROUND, 'ground'))

    def connect(
        self,
        connection: Connection,
        end: Floats | None = None,
        at: ElementTree.Element | None = None,
    ) -> None:
        """Add a connection, of which the child's end (3,) is drawn at `end`, and that stands at an
        element of the file. Raises InputError.

        The ground comes first: turned round, a joint has the same coordinates about -axes. A loop
        may have the name of a joint in the file: it gets another one.
        """
        name, (parent, child) = connection.name, (connection.parent, connection.child)
        if parent == child:
            body = 'the ground' if parent == GROUND else f'one body, {parent!r}'
            raise self.error(name, f'both sides are of {body}', at)
        gap = 0.0 if end is None else float(np.linalg.norm(end - connection.place))
        if gap > 0.0 and gap > _OPEN * max(
            [1e-300, *(float(abs(p.origin).max()) for p in self.parts)]
        ):
            raise self.error(
                name,
                f'its two ends are drawn {gap:.6g} m apart',
                at,
                expected='positions of the joints at which they meet: --set JOINT=NUMBER',
            )
        if child == GROUND:
            axes = tuple(-axis for axis in reversed(connection.axes))
            start, place = connection.start, connection.place
            forces = tuple(reversed(connection.of_axes))
            connection = replace(connection, parent=child, child=parent, axes=axes, of_axes=forces)
            if start is not None:
                connection = replace(connection, start=place, place=start)
            if forces:
                self.leave('names, changed', f'the second axis of {name} is {name}_first')
        if (own := free_name(name, {each.name for each in self.connections})) != name:
            self.leave('names, changed', f'loop {name} is {own}')
            connection = replace(connection, name=own)
        self.connections.append(connection)
        self.places[connection.name] = at

    def add_links(
        self, links: Mapping[str, RobotPart], root_of: Mapping[str, str]
    ) -> dict[str, str]:
        """Add a part for all links of one root, named after the heaviest; links of the ground have
        no part. Returns the part of each link."""
        members: dict[str, list[RobotPart]] = {}
        for name, link in links.items():
            members.setdefault(root_of[name], []).append(link)
        named = {GROUND: GROUND}
        for root, parts in members.items():
            if root == GROUND:
                continue
            named[root] = max(parts, key=lambda part: part.mass).name
            part = lumped(named[root], links[root].origin, parts)
            if part.mass == 0.0:
                self.leave('mass: there is none', part.name)
            self.parts.append(part)
        return {link: named[root] for link, root in root_of.items()}

    def lift(
        self,
        links: Mapping[str, RobotPart],
        part_of: Mapping[str, str],
        weightless: Container[str],
    ) -> None:
        """Add a force on each part of which links are without gravity: their weight, upwards, at
        their centre of mass.

        links: as drawn; part_of: of each link; weightless: the links without gravity.
        """
        for part in self.parts if any(self.gravity) else ():
            inside = (link for link, other in part_of.items() if other == part.name)
            own = [link for link in inside if link in links and links[link].mass]
            without = [links[link] for link in own if link in weightless]
            lifted = lumped(part.name, part.origin, without) if without else part
            if without and lifted.mass:
                force = -lifted.mass * np.array(self.gravity) + 0.0
                whole = len(without) == len(own)
                self.lifts[part.name] = Lift(force, part.com if whole else lifted.com)

    def error(
        self, key: str, message: str, at: ElementTree.Element | None = None, **details: Any
    ) -> InputError:
        """`xml_file.refusal` of the file of the robot."""
        return xml_file.refusal(self.file, key, message, at, **details)


def free_name(wanted: str, taken: Container[str]) -> str:
    """The name wanted, or with the first number that makes it free."""
    name, n = wanted, 2
    while name in taken:
        name, n = f'{wanted}_{n}', n + 1
    return name


def lumped(name: str, origin: Floats, parts: Iterable[RobotPart]) -> RobotPart:
    """Several parts as one: masses added, inertia by Steiner's theorem."""
    parts = list(parts)
    if len(parts) == 1:
        return replace(parts[0], name=name, origin=origin)
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / (mass or 1.0)
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia += part.inertia + part.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    com = com if mass else origin
    return RobotPart(name, origin, mass, com, inertia, links=tuple(parts))

"""A mechanism: points, vectors, bodies and joints, as plain frozen data without arrays.

SI units throughout. World frame: planar mechanisms lie in the x-y plane, positive angles turn
counter-clockwise about +z (REP-103).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

from alf_ros.mechanism.memory import exactly
from alf_ros.mechanism.time_function import Signal, cosine, rate, sine
from alf_ros.mechanism.visual_shapes import VisualShape

GROUND = 'ground'

Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Point:
    """A named point; `at` is where it is drawn (m, world frame)."""

    name: str
    at: Numbers
    fixed: bool = False


@dataclass(frozen=True, slots=True)
class Vector:
    """A named unit vector in space; `along` is its direction as drawn (world frame)."""

    name: str
    along: Numbers
    fixed: bool = False


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body carried by its points and unit vectors.

    The body frame has its origin at the first point and its x axis towards the second. `local`
    holds each point in that frame (m), `axes` each vector, `com` the centre of mass (m). `inertia`
    is about the centre of mass (kg m^2): in the plane a number, in space the rows of a 3x3 matrix.
    In space a body is carried by three independent directions (to points, or vectors), or is a
    rod or a point, which have no orientation about themselves. `shapes` show it in viewers.
    """

    name: str
    points: tuple[str, ...]
    local: tuple[Numbers, ...]
    mass: float
    com: Numbers
    inertia: float | tuple[Numbers, ...]
    vectors: tuple[str, ...] = ()
    axes: tuple[Numbers, ...] = ()
    shapes: tuple[VisualShape, ...] = ()


@dataclass(frozen=True, slots=True)
class Frame:
    """Where a joint sits on a body: `origin` (m) and orthonormal `axes`, in the body frame.

    On the ground, in the world frame. The x axis is that along which a planar joint slides, the z
    axis that about which (and along which) a spatial one moves.
    """

    origin: Numbers
    axes: tuple[Numbers, ...]


@dataclass(frozen=True, slots=True)
class Freedom:
    """One freedom that a type of joint leaves: an angle or a length.

    In space an angle is about, and a length along the z axis of the joint; in the plane a length
    is along its x axis. `suffix`: the end of the coordinate's name after the name of the joint, if
    the type leaves several. `on_child`: an angle about the child's x axis. `alone`: no other angle
    of the joint moves its axis, so that a torque about that axis is an effort on this freedom
    only.
    """

    is_angle: bool
    suffix: str = ''
    on_child: bool = False
    alone: bool = True


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between `parent` and `child` (bodies, or 'ground').

    kind: its type, by the name of its file in `alf_ros/model/joints`. `frames` are the frames of
    the joint on parent and child. The shared point and axis are `point` and `vector`: they need no
    constraint. `value` is a further number of the type: a length (m), the radius of the child (m)
    or an advance (m/rad); `of_parent` is the radius of the parent (m), and the smaller of an
    internal pair is negative. `motion`, if it has any, is a function of time: an angle (rad) by
    which a direction is `turning` on the child, or the velocity of the surface on which the child
    rolls: along each axis of the parent's frame (m/s), in space then its spin about the normal
    through the frame's origin (rad/s). `angles` are the names of the three angles of a ball that
    stands for revolutes in a row: about z of the parent's frame, about x of both, and about z
    turned by `value` about x, on the child.

    The type defines the `freedoms` that it leaves, and the `auxiliary` blocks that its rows need,
    by the ends of their names after the name of the joint.
    """

    name: str
    kind: str
    parent: str
    child: str
    frames: tuple[Frame, Frame]
    point: str | None = None
    vector: str | None = None
    value: float = 0.0
    of_parent: float = 0.0
    motion: tuple[Signal, ...] = ()
    turning: bool = False
    angles: tuple[str, ...] = ()
    auxiliary: tuple[str, ...] = ()
    freedoms: tuple[Freedom, ...] = field(default=(), compare=False)
    bearing: Bearing | None = None


@dataclass(frozen=True, slots=True)
class Bearing:
    """Stiffness of a joint against translation (N/m) and rotation (N m/rad), infinite if rigid. It
    decides how joints share loads that rigid bodies leave open, and changes no motion."""

    translation: float
    rotation: float


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One freedom of a joint: an angle (rad), at `place` less that at `less`, or a length (m).

    `place` counts angles or lengths, whichever it is; `less` is -1 for none.
    """

    name: str
    joint: Joint
    is_angle: bool
    place: int
    less: int = -1
    freedom: Freedom = Freedom(True)


@dataclass(frozen=True, slots=True)
class Drive:
    """A motion prescribed as a function of time (rheonomic); the drive exerts an effort.

    kind: 'angle' (rad) or 'length' (m) of a joint coordinate, 'distance' (m) between two points,
    'point' (m), the place of one. `of`: the name of the coordinate, or of the points. `motion` has
    one function, of a point one for each axis, None where it is free. `from_ground`: the angle is
    measured from axes that do not move.
    """

    name: str
    kind: str
    of: tuple[str, ...]
    motion: tuple[Signal | None, ...]
    from_ground: bool = False


@dataclass(frozen=True, slots=True)
class Coupling:
    """Joint coordinates `of` (name, factor) whose sum, each times its factor, stays as drawn."""

    name: str
    of: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class Rotor:
    """A rotor geared to joint coordinates `of` (name, factor): its rate is the sum of theirs, each
    times its factor. Its inertia as seen from there: kg m^2, or kg."""

    name: str
    of: tuple[tuple[str, float], ...]
    inertia: float


@dataclass(frozen=True, slots=True)
class PrescribedBlock:
    """A block that moves as functions of time: m, or a unit vector in the frame of a joint."""

    name: str
    components: tuple[Signal | None, ...]
    is_direction: bool


@dataclass(frozen=True)
class Mechanism:
    """Points, vectors, bodies and joints in the order of the file. The graph is undirected.

    `shapes` show the ground in viewers, in the world frame.
    """

    name: str
    points: tuple[Point, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    vectors: tuple[Vector, ...] = ()
    dimension: int = 2
    drives: tuple[Drive, ...] = ()
    rotors: tuple[Rotor, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    shapes: tuple[VisualShape, ...] = ()

    def with_bodies(self, bodies: tuple[Body, ...]) -> Mechanism:
        """The same with other masses: bodies of these names and shapes."""
        found = replace(self, bodies=bodies)
        # none of these depends on masses
        for name in ('coordinates', 'coordinate', 'prescribed', 'auxiliary', 'geometry'):
            vars(found)[name] = getattr(self, name)
        return found

    @cached_property
    def body(self) -> dict[str, Body]:
        """Bodies by name."""
        return {body.name: body for body in self.bodies}

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The coordinates of all joints."""
        return tuple(_coordinates(self))

    @cached_property
    def coordinate(self) -> dict[str, Coordinate]:
        """The coordinates of all joints, by name."""
        return {each.name: each for each in self.coordinates}

    @cached_property
    def coupled(self) -> frozenset[str]:
        """Names of the coordinates that couplings bind."""
        return frozenset(name for coupling in self.couplings for name, _ in coupling.of)

    @cached_property
    def ball_angles(self) -> tuple[str, ...]:
        """Names of the angles of balls, three of each that has some. They can be read, but are no
        coordinates: near gimbal lock they jump while the bodies move smoothly."""
        return tuple(name for joint in self.joints for name in joint.angles)

    @cached_property
    def prescribed(self) -> tuple[PrescribedBlock, ...]:
        """Motions as functions of time: for the drives, then for joints, by their names."""
        found = [_of_drive(drive) for drive in self.drives]
        for joint in self.joints:
            if joint.motion and joint.turning:
                found.append(_turning(joint.name, joint.motion[0]))
            elif joint.motion:
                found.append(PrescribedBlock(joint.name, tuple(map(rate, joint.motion)), False))
        return tuple(found)

    @cached_property
    def auxiliary(self) -> tuple[str, ...]:
        """Blocks that belong to no body: of rotors, and what rows need besides (`auxiliary`).

        By a name of the file, or with a dot after it, which no name of a file has.
        """
        names = [rotor.name for rotor in self.rotors]
        names += [d.name for d in self.drives if d.kind == 'angle' and not d.from_ground]
        names += [joint.name + suffix for joint in self.joints for suffix in joint.auxiliary]
        return tuple(names)

    @cached_property
    def structure(self) -> tuple[object, ...]:
        """The parts that are no numbers: which items exist, and what they are between. Which
        coefficients of rows are zero depends on numbers too."""
        items = [(item.name, item.fixed) for item in self.blocks]
        bodies = [(b.name, b.points, b.vectors) for b in self.bodies]
        joints = [
            (
                j.name,
                j.kind,
                j.parent,
                j.child,
                j.point,
                j.vector,
                j.motion,
                j.turning,
                j.angles,
            )
            for j in self.joints
        ]
        rotors = [(each.name, tuple(name for name, _ in each.of)) for each in self.rotors]
        couplings = [(each.name, tuple(name for name, _ in each.of)) for each in self.couplings]
        return self.dimension, items, bodies, joints, self.drives, rotors, couplings

    @cached_property
    def geometry(self) -> bytes | None:
        """The parts that coordinates and rows depend on, exactly, as a key: all but masses,
        stiffnesses and functions of time. None where functions of time turn or carry joints, and
        of many members at once (`columns`)."""
        if any(joint.motion for joint in self.joints):
            return None
        items = [(item.name, item.at, item.fixed) for item in self.points]
        items += [(item.name, item.along, item.fixed) for item in self.vectors]
        bodies = [(b.name, b.points, b.local, b.vectors, b.axes) for b in self.bodies]
        joints = [
            (
                (j.name, j.kind, j.parent, j.child, j.point, j.vector, j.value, j.of_parent),
                tuple((frame.origin, frame.axes) for frame in j.frames),
                j.auxiliary,
            )
            for j in self.joints
        ]
        drives = [
            (d.name, d.kind, d.of, tuple(each is None for each in d.motion), d.from_ground)
            for d in self.drives
        ]
        rotors = [(rotor.name, rotor.of) for rotor in self.rotors]
        couplings = [(coupling.name, coupling.of) for coupling in self.couplings]
        parts = (items, bodies, joints, drives, rotors, couplings)
        try:
            return exactly((self.dimension, *(tuple(part) for part in parts)))
        except ValueError:
            return None

    @property
    def blocks(self) -> tuple[Point | Vector, ...]:
        """The parts of the natural coordinates: points, then vectors."""
        return (*self.points, *self.vectors)


def _of_drive(drive: Drive) -> PrescribedBlock:
    if drive.kind == 'angle':
        assert drive.motion[0] is not None
        return _turning(drive.name, drive.motion[0])
    return PrescribedBlock(drive.name, drive.motion, False)


def _turning(name: str, angle: Signal) -> PrescribedBlock:
    return PrescribedBlock(name, (cosine(angle), sine(angle)), True)


def _coordinates(mechanism: Mechanism) -> Iterator[Coordinate]:
    body = {body.name: n for n, body in enumerate(mechanism.bodies)}
    planar, angles, lengths = mechanism.dimension == 2, 0, 0
    for joint in mechanism.joints:
        for freedom in joint.freedoms:
            several = len(joint.freedoms) > 1
            name = f'{joint.name}_{freedom.suffix}' if several else joint.name
            if not freedom.is_angle:
                yield Coordinate(name, joint, False, lengths, freedom=freedom)
                lengths += 1
            elif planar:
                less = body.get(joint.parent, -1) if joint.parent != GROUND else -1
                yield Coordinate(name, joint, True, body[joint.child], less, freedom)
            else:
                yield Coordinate(name, joint, True, angles, freedom=freedom)
                angles += 1

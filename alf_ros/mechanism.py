"""A mechanism: points, vectors, bodies and joints, as plain frozen data without arrays.

SI units throughout. World frame: planar mechanisms lie in the x-y plane, positive angles turn
counter-clockwise about +z (REP-103).
"""

from __future__ import annotations

from dataclasses import dataclass

GROUND = 'ground'

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Point:
    """A named point; `at` is where it is drawn (m, world frame)."""

    name: str
    at: Numbers
    fixed: bool = False


@dataclass(frozen=True)
class Vector:
    """A named unit vector in space; `along` is its direction as drawn (world frame)."""

    name: str
    along: Numbers
    fixed: bool = False


@dataclass(frozen=True)
class Body:
    """A rigid body carried by its points and unit vectors.

    The body frame has its origin at the first point and its x axis towards the second. `local`
    holds each point in that frame (m), `axes` each vector, `com` the centre of mass (m). `inertia`
    is about the centre of mass (kg m^2): in the plane a number, in space the rows of a 3x3 matrix.
    In space a body is carried by three independent directions (to points, or vectors), or is a
    rod or a point, which have no orientation about themselves.
    """

    name: str
    points: tuple[str, ...]
    local: tuple[Numbers, ...]
    mass: float
    com: Numbers
    inertia: float | tuple[Numbers, ...]
    vectors: tuple[str, ...] = ()
    axes: tuple[Numbers, ...] = ()


@dataclass(frozen=True)
class Frame:
    """Where a joint sits on a body: `origin` (m) and orthonormal `axes`, in the body frame.

    On the ground, in the world frame. The x axis is that along which a planar joint slides, the z
    axis that about which (and along which) a spatial one moves.
    """

    origin: Numbers
    axes: tuple[Numbers, ...]


@dataclass(frozen=True)
class Joint:
    """A joint between `parent` and `child` (bodies, or 'ground').

    kind: in the plane 'revolute', 'slider', 'prismatic', 'weld', 'gear', 'rack', 'blade',
    'no_slip'; in space
    'spherical', 'revolute', 'universal', 'cylindrical', 'prismatic', 'planar', 'weld', 'distance',
    'perpendicular', 'no_slip'. `frames` are those of the joint on parent and child. What the two
    share is named `point` and `vector` (the axis): it needs no constraint. `value` is what the
    kind needs besides: 'distance': m; 'no_slip', 'rack', 'gear': radius of the child, m. A gear
    has that of its parent too (`of_parent`, m); the smaller of an internal pair is negative.
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


@dataclass(frozen=True)
class Mechanism:
    """Points, vectors, bodies and joints in the order of the file. The graph is undirected."""

    name: str
    points: tuple[Point, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    vectors: tuple[Vector, ...] = ()
    dimension: int = 2

    @property
    def blocks(self) -> tuple[Point | Vector, ...]:
        """What the natural coordinates are made of: points, then vectors."""
        return (*self.points, *self.vectors)

"""A mechanism: points, bodies and joints, as plain frozen data without arrays.

SI units throughout. World frame: planar mechanisms lie in the x-y plane, positive angles turn
counter-clockwise about +z (REP-103).
"""

from __future__ import annotations

from dataclasses import dataclass

GROUND = 'ground'


@dataclass(frozen=True)
class Point:
    """A named point; `at` is where it is drawn (m, world frame)."""

    name: str
    at: tuple[float, ...]
    fixed: bool = False


@dataclass(frozen=True)
class Body:
    """A rigid body carried by its points.

    The body frame has its origin at the first point and its x axis towards the second. `local`
    holds each point in that frame (m), `com` the centre of mass (m), `inertia` the moment of
    inertia about the centre of mass (kg m^2).
    """

    name: str
    points: tuple[str, ...]
    local: tuple[tuple[float, ...], ...]
    mass: float
    com: tuple[float, ...]
    inertia: float


@dataclass(frozen=True)
class Joint:
    """A joint between `parent` and `child` (bodies, or 'ground') at `point`.

    kind: 'revolute' (the bodies share the point) or 'slider' (the point stays on the line through
    `through` (m) along the unit vector `direction`, both fixed in the parent, which is the
    ground).
    """

    name: str
    kind: str
    parent: str
    child: str
    point: str
    through: tuple[float, ...] | None = None
    direction: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Mechanism:
    """Points, bodies and joints in the order of the file. The graph is undirected."""

    name: str
    points: tuple[Point, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    dimension: int = 2

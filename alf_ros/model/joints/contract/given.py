"""A joint in a mechanism file, as the type that makes a joint of it sees it."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism import Body, Frame, Joint, Numbers
from alf_ros.mechanism.time_function import Signal


class Surface(NamedTuple):
    """A line or plane of a file: a place `through` it (m), the direction of the line or the normal
    of the plane, and how it moves (see `Joint.motion`)."""

    through: Numbers
    along: Floats
    motion: tuple[Signal, ...]


class Given(Protocol):
    """A joint as a file says it. What cannot be read raises InputError, with file, line and key.

    Directions are of the world, as drawn. `n` is the item of a list that is meant.
    """

    shares_point: bool  # as its type has it
    parent: str
    child: str

    def has(self, key: str) -> bool:
        """Whether the file says it."""
        ...

    def error(self, key: str, message: str, n: int | None = None, **details: Any) -> InputError:
        """The error for the value of a key ('' for the joint as a whole)."""
        ...

    def point(self, key: str) -> str:
        """The name of a point that exists."""
        ...

    def points(self, key: str) -> tuple[str, str]:
        """The names of two points that exist."""
        ...

    def place(self, point: str) -> Numbers:
        """Where a point is drawn (m)."""
        ...

    def is_fixed(self, point: str) -> bool:
        """Whether a point is one of the ground."""
        ...

    def carries(self, body: str, point: str) -> bool:
        """Whether a point is one of a body's, or of the ground's."""
        ...

    def check_carries(self, key: str, point: str, body: str, n: int | None = None) -> None:
        """Refuse a point that belongs neither to a body nor to the ground."""
        ...

    def body(self, name: str) -> Body | None:
        """A body; None for the ground."""
        ...

    def direction(self, key: str) -> tuple[Floats, str | None]:
        """A unit direction, and the name of the vector if it is one that parent and child have."""
        ...

    def directions(self, key: str) -> tuple[Floats, Floats]:
        """Two unit directions."""
        ...

    def named_directions(self, key: str) -> dict[str, Floats]:
        """Three unit directions by name."""
        ...

    def number(self, key: str) -> float:
        """A number."""
        ...

    def radius(self, key: str, n: int | None = None) -> float:
        """A radius: m, more than zero."""
        ...

    def boolean(self, key: str) -> bool:
        """Whether it is true; not if it is absent."""
        ...

    def motion(self, key: str) -> tuple[Signal, ...]:
        """A function of time; none if it is absent."""
        ...

    def surface(self, key: str, may_move: bool = True) -> Surface:
        """A line, or plane, of the ground."""
        ...

    def find_body(self, key: str, point: str) -> None:
        """Take the ground as parent and the body with a point as child, named or not."""
        ...

    def axes(self, along: Floats) -> Floats:
        """(D, D) axes in rows, of which x in the plane, z in space is `along`."""
        ...

    def frame(self, body: str, point: str, axes: Floats | None = None) -> Frame:
        """At a point, along axes in rows (by default the world axes), on a body."""
        ...

    def frame_at(self, body: str, place: Numbers, axes: Floats | None = None) -> Frame:
        """At a place of the world (m), likewise."""
        ...

    def joint(self, parent: Frame, child: Frame, **more: Any) -> Joint:
        """The joint between these frames; `more` are fields of `Joint`."""
        ...


def at_a_point(given: Given, axes: Floats | None = None, **more: Any) -> Joint:
    """A joint whose two frames coincide as drawn, at the point `at`, which one body at least has.

    Along `axis`, if the type has that key; else along `axes` (rows). `more`: fields of `Joint`.
    """
    point, vector = given.point('at'), None
    if given.has('axis'):
        along, vector = given.direction('axis')
        axes = given.axes(along)
    carried = [given.carries(body, point) for body in (given.parent, given.child)]
    if not any(carried):
        message = f'neither {given.parent} nor {given.child} carries it'
        raise given.error('at', message, value=point)
    shares = all(carried) and given.shares_point
    frames = [given.frame(body, point, axes) for body in (given.parent, given.child)]
    return given.joint(*frames, point=point if shares else None, vector=vector, **more)

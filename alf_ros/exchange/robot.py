"""A robot as other formats describe it: rigid parts, connections between them, what acts.

All places and directions are in the world frame, as drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND
from alf_ros.model import joints

_OPEN = 1e-6  # of the robot's size: how far the two ends of a loop may be apart as drawn

# the types of joints that other formats have, by the number of axes that each needs
AXES = {kind: each.axes for kind, each in joints.types(3).items() if each.axes is not None}


@dataclass(frozen=True)
class Pose:
    """A frame: `origin` (3,) m, `turn` (3, 3) whose columns are its axes."""

    origin: Floats
    turn: Floats

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.place(other.origin), self.turn @ other.turn)

    def place(self, inner: Sequence[float] | Floats) -> Floats:
        """A place of this frame in the outer one."""
        return self.origin + self.turn @ np.asarray(inner, dtype=float)


STILL = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class Part:
    """A rigid body: origin of its frame (m), mass (kg), com (m), inertia (3, 3) there, kg m^2."""

    name: str
    origin: Floats
    mass: float
    com: Floats
    inertia: Floats


@dataclass(frozen=True)
class Connection:
    """A joint at `place`, with its unit axes; `AXES` says how many.

    What acts on its coordinate, whose value as drawn is `drawn`: viscous `damping`, a spring of
    `stiffness` that rests at `rest`; `limits` of the coordinate. rad or m, N m or N.
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


@dataclass
class Robot:
    """Parts and connections; `left_out` says, by kind, what of the source is not among them."""

    name: str
    file: str
    gravity: tuple[float, ...]
    parts: list[Part] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    left_out: dict[str, list[str]] = field(default_factory=dict)

    def leave(self, kind: str, name: str) -> None:
        """Note that something of `name` is not carried over."""
        names = self.left_out.setdefault(kind, [])
        if name not in names:
            names.append(name)

    def connect(self, connection: Connection, end: Floats | None = None) -> None:
        """Add a connection, of which the child's end (3,) is drawn at `end`. Raises InputError."""
        name, (parent, child) = connection.name, (connection.parent, connection.child)
        if parent == child:
            raise self.error(name, f'both sides are of one body, {parent!r}')
        if child == GROUND:
            raise self.error(name, 'the ground comes first')
        gap = 0.0 if end is None else float(np.linalg.norm(end - connection.place))
        if gap > _OPEN * max([1e-300, *(float(abs(p.origin).max()) for p in self.parts)]):
            raise self.error(
                name,
                f'its two ends are drawn {gap:.6g} m apart',
                expected='positions of the joints at which they meet: --set JOINT=NUMBER',
            )
        self.connections.append(connection)

    def error(self, key: str, message: str, expected: str | None = None) -> InputError:
        return InputError(message, file=self.file, key=key, expected=expected)


def lumped(name: str, origin: Floats, parts: Iterable[Part]) -> Part:
    """Several parts as one: masses added, inertia by Steiner's theorem."""
    parts = list(parts)
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / (mass or 1.0)
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia += part.inertia + part.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    return Part(name, origin, mass, com if mass else origin, inertia)

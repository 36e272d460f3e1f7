"""The `bodies` of a mechanism file: what carries them, their frames as drawn, mass and inertia."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats
from alf_ros.mechanism import Body, Numbers, Point, Vector
from alf_ros.mechanism.memory import remembered
from alf_ros.scene.mechanism_file.shapes_section import KEY as SHAPES
from alf_ros.scene.mechanism_file.shapes_section import ShapeReader
from alf_ros.scene.text import repetition
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry

KEYS = ('points', 'mass', 'inertia', 'com', 'length', SHAPES)  # the first two are required
IN_SPACE = ('vectors',)
INERTIAS = ('rod', 'point')  # besides `about_com`
_COINCIDENT = 1e-12  # of their largest coordinate: closer points give no direction
_LOST = 1e-15  # of all coordinates: shorter lengths drown in the rounding when loops are closed
_SHORTEST = 1e-100  # m: the square of less would vanish
_ROUNDING = 1e-12  # of the largest moment
_PARALLEL = 1e-6  # sine of the angle below which directions count as parallel


@dataclass(frozen=True, slots=True)
class Pose:
    """A body frame as drawn: `origin` (m) and `axes`, one in each row, in the world frame."""

    origin: Numbers
    axes: tuple[Numbers, ...]

    def place(self, world: Numbers) -> Numbers:
        """A place of the world (m) in the body frame."""
        return _numbers(columns.dot(np.array(self.axes), np.array(world) - self.origin))

    def direction(self, world: Numbers | Floats) -> Numbers:
        """A direction of the world in the body frame."""
        return _numbers(columns.dot(np.array(self.axes), np.array(world)))

    @property
    def of_world(self) -> tuple[Numbers, ...]:
        """The axes of the world in the body frame."""
        return _transposed(self.axes)


class BodyReader:
    """Reads bodies on the points and vectors that exist. Raises InputError."""

    def __init__(
        self,
        points: Mapping[str, Point],
        vectors: Mapping[str, Vector],
        dimension: int,
        shapes: ShapeReader,
    ) -> None:
        self.points, self.vectors, self.dimension = points, vectors, dimension
        self.shapes = shapes
        self.poses: dict[str, Pose] = {}
        self.alike: dict[tuple[Numbers, ...], tuple[Numbers, ...]] = {}  # kept once: many bodies
        self.size = columns.largest(abs(x) for point in points.values() for x in point.at)

    def read(self, section: Entry, names: Mapping[str, float]) -> Iterator[tuple[Item, Body]]:
        """Yield the bodies of a section; `names` are parameters. Raises InputError."""
        keys = KEYS if self.dimension == 2 else KEYS + IN_SPACE
        for item in repetition.repeated(section, repetition.keys(keys, KEYS[:2]), names):
            yield item, self.body(item)

    def body(self, item: Item) -> Body:
        """The body of one item, with its points in its frame (m). Raises InputError."""
        points = self.references(item, 'points', self.points)
        vectors = self.references(item, 'vectors', self.vectors)
        if not points:
            raise item.fields['points'].error(f'body {item.name!r} has no points')
        local, axes = self.frame(item, points, vectors)
        mass, com, inertia = self.masses(item, local, bool(vectors))
        shown = self.shapes.read(item.fields[SHAPES], item.names) if SHAPES in item.fields else ()
        return Body(item.name, points, local, mass, com, inertia, vectors, axes, shown)

    def references(
        self, item: Item, key: str, known: Mapping[str, Point] | Mapping[str, Vector]
    ) -> tuple[str, ...]:
        """Distinct points or vectors of a body."""
        names: list[str] = []
        for entry in item.fields[key].sequence() if key in item.fields else ():
            name = repetition.name(entry, item.names)
            if name not in known:
                raise entry.error(f'no such {key[:-1]}', value=name, choices=known)
            if name in names:
                raise entry.error(f'{key[:-1]} given twice', value=name)
            names.append(name)
        return tuple(names)

    # ------------------------------------------------------------------------------------- frames

    def frame(
        self, item: Item, points: tuple[str, ...], vectors: tuple[str, ...]
    ) -> tuple[tuple[Numbers, ...], tuple[Numbers, ...]]:
        """Points (m) and vectors in the body frame: origin at the first point, x to the second."""
        drawn = [self.points[name].at for name in points]
        span = self.span(item, drawn)
        along = [np.array(self.vectors[name].along) for name in vectors]
        axes: tuple[Numbers, ...]
        if self.dimension == 2:
            (a, b), (c, d) = drawn[0], drawn[1] if span else drawn[0]
            x, y = ((c - a) / span, (d - b) / span) if span else (1.0, 0.0)
            axes = (x, y), (-y, x)
        else:
            to = [np.array(place) - drawn[0] for place in drawn[1:]]
            directions = np.array([*to[:1], *along, *to[1:]]).reshape(-1, 3)
            axes = tuple(map(_numbers, frame_axes(directions)))
        pose = self.poses[item.name] = Pose(drawn[0], self.alike.setdefault(axes, axes))
        zero = (0.0,) * self.dimension
        if 'length' in item.fields:
            if len(points) != 2:
                raise item.fields['length'].error('a length is for bodies of two points')
            span = item.fields['length'].number(item.names)
            if span <= columns.largest((_LOST * self.size, _SHORTEST)):
                raise item.fields['length'].error('not a length', expected='m, more than zero')
        second = ((span, *zero[1:]),) if len(points) > 1 else ()
        further = tuple(map(pose.place, drawn[2:]))
        local = (zero, *second, *further)
        return self.alike.setdefault(local, local), tuple(map(pose.direction, along))

    def span(self, item: Item, drawn: Sequence[Numbers]) -> float:
        """Distance of the first two points, m; zero for a body of one."""
        if len(drawn) == 1:
            return 0.0
        span: float = columns.distance(drawn[0], drawn[1])
        own = _COINCIDENT * columns.largest(map(abs, (*drawn[0], *drawn[1])))
        if span <= columns.largest((own, _LOST * self.size, _SHORTEST)):
            raise item.fields['points'].error(
                f'the first two points of {item.name!r} are drawn at the same place'
            )
        return span

    # ---------------------------------------------------------------------------- mass, inertia

    def masses(
        self, item: Item, local: tuple[Numbers, ...], oriented: bool
    ) -> tuple[float, Numbers, float | tuple[Numbers, ...]]:
        """Mass (kg), centre of mass and inertia of a body with these points in its frame (m).
        `oriented`: the file gives it vectors. Raises InputError."""
        mass = item.fields['mass'].number(item.names)
        if mass < 0.0:
            raise item.fields['mass'].error('negative mass', expected='kg, zero or more')
        return (mass, *self.inertia(item, local, mass, oriented))

    def inertia(
        self, item: Item, local: tuple[Numbers, ...], mass: float, oriented: bool
    ) -> tuple[Numbers, float | tuple[Numbers, ...]]:
        """Centre of mass in the body frame (m) and inertia about it (kg m²)."""
        kind, inertia = self.moment(item, local, mass)
        centre = item.fields.get('com')
        com = None if centre is None else centre.vector(self.dimension, item.names)
        zero = (0.0,) * self.dimension
        alone = len(local) == 1 and not oriented
        if alone and self.dimension == 2:
            if kind == 'rod' or np.any(inertia):
                raise item.fields['inertia'].error(
                    f'body {item.name!r} has one point, which cannot turn', expected='point'
                )
        if len(local) == 1 and kind == 'rod':
            raise item.fields['inertia'].error('a rod has two points', value='rod')
        if alone and kind != 'about_com':
            if centre is not None and com != zero:
                message = 'a body of one point has its mass there'
                raise centre.error(message, expected=str(list(zero)))
            return zero, inertia
        if com is not None:
            return com, inertia
        if kind == 'rod' or mass == 0.0 or (kind == 'about_com' and len(local) == 2):
            return (0.5 * local[1][0] if len(local) > 1 else 0.0, *zero[1:]), inertia
        if len(local) == 1:
            return zero, inertia
        raise item.entry.error(f"missing key 'com': where is the mass of {item.name!r}?")

    def moment(
        self, item: Item, local: tuple[Numbers, ...], mass: float
    ) -> tuple[str, float | tuple[Numbers, ...]]:
        """The value of `inertia`: 'rod', 'point' or 'about_com', and its value (kg m²)."""
        entry = item.fields.get('inertia')
        if entry is None:
            if mass > 0.0:
                raise item.entry.error(f"missing key 'inertia': {item.name!r} has a mass")
            return 'point', self.rod(0.0)
        if isinstance(entry.value, dict):
            about = entry.mapping(('about_com',), ('about_com',))['about_com']
            if self.dimension == 3:
                return 'about_com', _tensor(about, item.names)
            inertia = about.number(item.names)
            if inertia < 0.0:
                raise about.error('negative inertia', expected='kg m^2, zero or more')
            return 'about_com', inertia
        if entry.value not in INERTIAS:
            raise entry.error('unknown inertia', expected='rod, point or {about_com: J}')
        length = local[1][0] if entry.value == 'rod' and len(local) > 1 else 0.0
        return str(entry.value), self.rod(mass * length * length / 12.0)

    def rod(self, across: float) -> float | tuple[Numbers, ...]:
        """Inertia of a slender rod along x."""
        if self.dimension == 2:
            return across
        return ((0.0, 0.0, 0.0), (0.0, across, 0.0), (0.0, 0.0, across))


def _tensor(entry: Entry, names: Mapping[str, float]) -> tuple[Numbers, ...]:
    """The inertia tensor: three moments; xx, yy, zz, xy, xz, yz; or three rows of three."""
    parts = entry.sequence()
    expected = '[Jxx, Jyy, Jzz], [Jxx, Jyy, Jzz, Jxy, Jxz, Jyz] or three rows of three'
    if len(parts) == 3 and isinstance(parts[0].value, tuple):
        J = columns.array([row.vector(3, names) for row in parts])
    elif len(parts) in (3, 6):
        xx, yy, zz, xy, xz, yz = [*(part.number(names) for part in parts), 0.0, 0.0, 0.0][:6]
        J = columns.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        raise entry.error('not an inertia', expected=expected)
    most = _ROUNDING * abs(J[0, 0] + J[1, 1] + J[2, 2])
    if any(abs(J[i, k] - J[k, i]) > most for i, k in ((0, 1), (0, 2), (1, 2))):
        raise entry.error('not symmetric', expected=expected)
    J = 0.5 * (J + J.T)  # a tensor that was turned is symmetric to rounding
    moments = columns.eigenvalues(J)
    # a slender rod has a moment of zero: turning it leaves rounding
    if moments[0] < -_ROUNDING * moments[2] or moments[0] + moments[1] < moments[2] * (1.0 - 1e-9):
        message = 'no body has such an inertia: each principal moment is at most the sum of others'
        raise entry.error(message, value=[float(f'{moment:.6g}') for moment in moments])
    return tuple(_numbers(row) for row in J)


@remembered(1024)
def frame_axes(directions: Floats) -> Floats:
    """Right-handed axes (3, 3): x along the first direction (directions, 3), y in the plane of the
    next."""
    axes: list[Floats] = []
    for d in [*directions, *np.eye(3)]:
        size = columns.norm(d)
        rest = d - sum((columns.dot(d, axis) * axis for axis in axes), np.zeros(3))
        if len(axes) < 2 and size > 0.0 and columns.norm(rest) > _PARALLEL * size:
            axes.append(rest / columns.norm(rest))
    x, y = axes
    return np.array([x, y, np.cross(x, y)])


@remembered(1024)
def _transposed(axes: tuple[Numbers, ...]) -> tuple[Numbers, ...]:
    """Columns for rows; of all bodies that stand alike at once."""
    return tuple(tuple(x + 0.0 for x in column) for column in zip(*axes, strict=True))


def _numbers(values: Floats) -> Numbers:
    return tuple(values.tolist())

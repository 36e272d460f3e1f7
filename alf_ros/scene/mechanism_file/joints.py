"""The `joints` of a mechanism file.

Every joint is a pair of frames, one on the parent and one on the child, that coincide as drawn
(unless one of them slides along the other); what both bodies carry needs no constraint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from itertools import chain

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND, Body, Frame, Joint, Numbers, Point, Vector
from alf_ros.mechanism.time_function import Signal, signal
from alf_ros.scene.mechanism_file import gears
from alf_ros.scene.mechanism_file.bodies import Pose
from alf_ros.scene.text import repetition
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry

# what each type needs besides `between`, for each dimension
PLANAR = {
    'revolute': ('at',),
    'slider': ('point', 'on'),
    'prismatic': ('at', 'axis'),
    'weld': ('at',),
    'gear': ('centres', 'radii'),
    'rolling': ('centres', 'radii'),
    'rack': ('at', 'on', 'radius'),
    'blade': ('at', 'axis'),
    'no_slip': ('at', 'on', 'radius'),
}
SPATIAL = {
    'spherical': ('at',),
    'revolute': ('at', 'axis'),
    'universal': ('at', 'axes'),
    'cylindrical': ('at', 'axis'),
    'prismatic': ('at', 'axis'),
    'planar': ('at', 'axis'),
    'weld': ('at',),
    'perpendicular': ('axes',),
    'distance': ('points',),
    'no_slip': ('at', 'on', 'radius'),
    'disk': ('at', 'axle', 'on', 'radius'),
}
OPTIONAL = {
    'distance': ('length',),
    'gear': ('internal',),
    'rolling': ('internal',),
    'blade': ('angle',),
}
LINE, PLANE = ('through', 'direction'), ('through', 'normal')  # what `on` is, by dimension
MOVING_LINE, MOVING_PLANE = ('speed',), ('velocity', 'spin')  # where it moves
FREE_OF_BETWEEN = ('slider',)  # of which the body need not be named
ROLLING = ('blade', 'no_slip', 'disk')  # of a body on the ground


class JointReader:
    """Reads joints between the bodies and at the points that exist. Raises InputError."""

    def __init__(
        self,
        points: Mapping[str, Point],
        vectors: Mapping[str, Vector],
        bodies: Mapping[str, Body],
        poses: Mapping[str, Pose],
        dimension: int,
    ) -> None:
        self.points, self.vectors, self.bodies, self.poses = points, vectors, bodies, poses
        self.dimension = dimension
        self.ground = Pose((0.0,) * dimension, tuple(map(tuple, np.eye(dimension).tolist())))

    def read(self, section: Entry, names: Mapping[str, float]) -> Iterator[tuple[Item, Joint]]:
        for item in repetition.repeated(section, self.fields, names):
            kind = item.fields['type'].text()
            read = self.slider if kind == 'slider' else self.joint
            yield item, read(item, kind)

    def fields(self, entry: Entry) -> dict[str, Entry]:
        """The keys of a joint, which depend on its type."""
        types = PLANAR if self.dimension == 2 else SPATIAL
        other = SPATIAL if self.dimension == 2 else PLANAR
        if 'type' not in entry.mapping():
            keys = chain(('for', 'type', 'between'), *types.values(), *OPTIONAL.values())
            entry.mapping(tuple(dict.fromkeys(keys)), ('type',))
        each = entry.mapping()['type']
        kind = each.text()
        if kind in other and kind not in types:
            where = 'space' if self.dimension == 2 else 'the plane'
            raise each.error(f'a joint of {where}', choices=types)
        needed = types[each.text(types)]
        allowed = ('for', 'type', 'between', *needed, *OPTIONAL.get(kind, ()))
        between = () if kind in FREE_OF_BETWEEN else ('between',)
        return entry.mapping(allowed, (*between, *needed))

    def joint(self, item: Item, kind: str) -> Joint:
        """Any joint whose bodies are named."""
        fields = item.fields
        parent, child = self.between(fields['between'], item)
        if kind in ROLLING and parent != GROUND:
            message = f'{kind} is between the ground and a body'
            raise fields['between'].error(message, value=parent, expected=f'[ground, {child}]')
        if kind in ('gear', 'rolling'):
            return gears.gear(self, item, parent, child)
        if kind == 'rack':
            return gears.rack(self, item, parent, child)
        if kind == 'distance':
            return self.distance(item, parent, child)
        if kind == 'perpendicular':
            z, other = self.directions(fields['axes'], item)
            place = self.points[self.bodies[child].points[0]].at
            frames = self.at(parent, place, _frame(z)), self.at(child, place, _frame(other))
            return Joint(item.name, kind, parent, child, frames)
        point = self.point(fields['at'], item)
        if kind in ('no_slip', 'disk'):
            return self.wheel(item, child, point)
        vector, axes = None, None
        if kind == 'universal':
            z, x = self.directions(fields['axes'], item)
            if abs(z @ x) > 1e-9:
                raise fields['axes'].error('the axes of a universal joint are perpendicular')
            axes = np.array([x, np.cross(z, x), z])
        elif 'axis' in fields:
            along, vector = self.direction(fields['axis'], item)
            axes = _frame(along)
            if vector is not None and not all(map(self.has(vector), (parent, child))):
                vector = None
        carried = [self.carries(body, point) for body in (parent, child)]
        if self.dimension == 2 and kind == 'revolute' and not all(carried):
            for body in (parent, child):
                self.check_on(fields['at'], point, body)
        if not any(carried):
            raise fields['at'].error(f'neither {parent} nor {child} carries it', value=point)
        frames = self.frame(parent, point, axes), self.frame(child, point, axes)
        sharing = all(carried) and kind in ('revolute', 'spherical', 'universal', 'weld')
        motion = (fields['angle'].motion(item.names),) if 'angle' in fields else ()
        on = point if sharing else None
        return Joint(item.name, kind, parent, child, frames, on, vector, motion=motion)

    def slider(self, item: Item, kind: str) -> Joint:
        """A point of a body on a line of the ground; a body need not be named if there is one."""
        fields = item.fields
        point = self.point(fields['point'], item)
        if self.points[point].fixed:
            raise fields['point'].error('a fixed point cannot slide', value=point)
        if 'between' in fields:
            parent, child = self.between(fields['between'], item)
            if parent != GROUND:
                message = 'a slider is between the ground and a body'
                raise fields['between'].error(message, value=parent, expected=f'[ground, {child}]')
            self.check_on(fields['point'], point, child)
        else:
            child = self.only_carrier(point, item)
        line = fields['on'].mapping(LINE, LINE)
        through = line['through'].vector(2, item.names)
        along, _ = self.direction(line['direction'], item)
        frames = self.at(GROUND, through, _frame(along)), self.frame(child, point)
        return Joint(item.name, kind, GROUND, child, frames)

    def wheel(self, item: Item, child: str, point: str) -> Joint:
        """A wheel, in space also a ball or disk, that rolls on a line or plane of the ground."""
        self.check_on(item.fields['at'], point, child)
        keys = LINE if self.dimension == 2 else PLANE
        moving = MOVING_LINE if self.dimension == 2 else MOVING_PLANE
        kind = item.fields['type'].text()
        on = item.fields['on'].mapping((*keys, *(moving if kind != 'rack' else ())), keys)
        through = on['through'].vector(self.dimension, item.names)
        along, _ = self.direction(on[keys[1]], item)
        radius = item.fields['radius'].number(item.names)
        if not radius > 0.0:
            raise item.fields['radius'].error('not a radius', expected='m, more than zero')
        axes = _frame(along)
        own = axes
        if kind == 'disk':
            axle, _ = self.direction(item.fields['axle'], item)
            if np.linalg.norm(np.cross(axle, along)) < 1e-6:
                raise item.fields['axle'].error('the disk lies flat: no point of it is lowest')
            own = _frame(axle)
        frames = self.at(GROUND, through, axes), self.frame(child, point, own)
        motion = self.surface(on, axes, item)
        return Joint(item.name, kind, GROUND, child, frames, value=radius, motion=motion)

    def surface(self, on: Mapping[str, Entry], axes: Floats, item: Item) -> tuple[Signal, ...]:
        """How what a wheel rolls on moves; nothing if it does not."""
        if 'speed' in on:
            return (on['speed'].motion(item.names),)
        if 'velocity' not in on and 'spin' not in on:
            return ()
        velocity = [signal(0.0)] * 3
        if 'velocity' in on:
            velocity = [each.motion(item.names) for each in on['velocity'].sequence(3)]
        x, y = (
            sum((float(a) * v for a, v in zip(axis, velocity, strict=True)), signal(0.0))
            for axis in axes[:2]
        )
        spin = on['spin'].motion(item.names) if 'spin' in on else signal(0.0)
        return x, y, spin

    def distance(self, item: Item, parent: str, child: str) -> Joint:
        """A massless bar between a point of the parent and one of the child."""
        ends = item.fields['points'].sequence(2)
        points = [self.point(end, item) for end in ends]
        for end, point, body in zip(ends, points, (parent, child), strict=True):
            self.check_on(end, point, body)
        length = math.dist(*(self.points[point].at for point in points))
        if 'length' in item.fields:
            length = item.fields['length'].number(item.names)
        if not length > 0.0:
            raise item.entry.error('a bar without length', expected='m, more than zero')
        frames = self.frame(parent, points[0]), self.frame(child, points[1])
        return Joint(item.name, 'distance', parent, child, frames, value=length)

    # ------------------------------------------------------------------------------------- frames

    def frame(self, body: str, point: str, axes: Floats | None = None) -> Frame:
        """At a point, along axes of the world as drawn (rows; all of them if none), on a body."""
        if body != GROUND and point in self.bodies[body].points:
            each = self.bodies[body]
            origin = each.local[each.points.index(point)]
            return _kept(origin, self.axes(body, axes))
        return self.at(body, self.points[point].at, axes)

    def at(self, body: str, place: Numbers, axes: Floats | None) -> Frame:
        """At a place of the world, along axes of the world as drawn, on a body."""
        return Frame(self.pose(body).place(place), self.axes(body, axes))

    def axes(self, body: str, axes: Floats | None) -> tuple[Numbers, ...]:
        """Axes of the world as drawn, on a body."""
        pose = self.pose(body)
        return pose.of_world if axes is None else tuple(map(pose.direction, axes))

    def pose(self, body: str) -> Pose:
        return self.ground if body == GROUND else self.poses[body]

    def carries(self, body: str, point: str) -> bool:
        """Whether a point is one of a body's, or of the ground's."""
        if body == GROUND:
            return self.points[point].fixed
        return point in self.bodies[body].points

    def has(self, vector: str):  # type: ignore[no-untyped-def]
        """Whether a vector is one of a body's, or of the ground's."""
        return lambda body: (
            self.vectors[vector].fixed if body == GROUND else vector in self.bodies[body].vectors
        )

    # -------------------------------------------------------------------------------------- parts

    @cached_property
    def carriers(self) -> dict[str, list[str]]:
        """The bodies that carry each point."""
        found: dict[str, list[str]] = {}
        for body in self.bodies.values():
            for point in body.points:
                found.setdefault(point, []).append(body.name)
        return found

    def only_carrier(self, point: str, item: Item) -> str:
        """The body on a slider whose file names none."""
        bodies = self.carriers.get(point, [])
        if not bodies:
            raise item.entry.error(f'no body carries point {point!r}')
        if len(bodies) > 1:
            message = f'{" and ".join(bodies)} meet at {point}: say which one slides'
            raise item.entry.error(message, expected=f'between: [ground, {bodies[0]}]')
        return bodies[0]

    def point(self, entry: Entry, item: Item) -> str:
        name = repetition.name(entry, item.names)
        if name not in self.points:
            raise entry.error('no such point', value=name, choices=self.points)
        return name

    def between(self, entry: Entry, item: Item) -> tuple[str, str]:
        """Parent and child, two different bodies; the ground can only be the parent."""
        names = []
        for side in entry.sequence(2):
            name = repetition.name(side, item.names)
            if name != GROUND and name not in self.bodies:
                raise side.error('no such body', value=name, choices=(*self.bodies, GROUND))
            names.append(name)
        parent, child = names
        if parent == child:
            raise entry.error('a joint is between two bodies', value=parent)
        if child == GROUND:
            raise entry.error('the ground comes first', expected=f'[ground, {parent}]')
        return parent, child

    def check_on(self, entry: Entry, point: str, body: str) -> None:
        """Refuse a joint at a point that one of its bodies does not have."""
        if body == GROUND:
            if not self.points[point].fixed:
                raise entry.error('not a fixed point, so not of the ground', value=point)
        elif point not in self.bodies[body].points:
            carried = self.bodies[body].points
            raise entry.error(f'body {body!r} does not carry it', value=point, choices=carried)

    def directions(self, entry: Entry, item: Item) -> tuple[Floats, Floats]:
        first, second = (self.direction(each, item)[0] for each in entry.sequence(2))
        return first, second

    def direction(self, entry: Entry, item: Item) -> tuple[Floats, str | None]:
        """A unit direction of the world as drawn, and the name of the vector if it is one."""
        if isinstance(entry.value, str):
            name = repetition.name(entry, item.names)
            if name not in self.vectors:
                expected = 'a list of numbers'
                raise entry.error('no such vector', value=name, expected=expected)
            return np.array(self.vectors[name].along), name
        return unit(entry, self.dimension, item.names), None


@lru_cache(maxsize=1024)
def _kept(origin: Numbers, axes: tuple[Numbers, ...]) -> Frame:
    """A frame, of all bodies that are alike at once."""
    return Frame(origin, axes)


def unit(entry: Entry, dimension: int, names: Mapping[str, float]) -> Floats:
    """A direction, normalised; scaled first, so that no square over- or underflows."""
    d = np.array(entry.vector(dimension, names))
    scale = float(np.abs(d).max())
    if scale == 0.0:
        raise entry.error('zero is no direction')
    d = d / scale
    return d / math.hypot(*d)


def _frame(along: Floats) -> Floats:
    """Axes (rows) of which x in the plane, z in space is `along`."""
    if along.size == 2:
        return np.array([along, [-along[1], along[0]]])
    x = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    x = x / np.linalg.norm(x)
    return np.array([x, np.cross(along, x), along])

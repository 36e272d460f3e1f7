"""The `joints` of a mechanism file.

Every joint is a pair of frames, one on the parent and one on the child, that coincide as drawn
(unless one of them slides along the other); what both bodies carry needs no constraint.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache, cached_property
from typing import Any, NoReturn

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND, Body, Frame, Joint, Numbers, Point, Vector
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.time_function import Signal, signal
from alf_ros.model import joints
from alf_ros.model.joints.contract import JointType, Key, Surface
from alf_ros.scene.mechanism_file import bearings
from alf_ros.scene.mechanism_file.bodies import Pose
from alf_ros.scene.text import repetition
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry

LINE, PLANE = ('through', 'direction'), ('through', 'normal')  # what `on` is, by dimension
MOVING_LINE, MOVING_PLANE = ('speed',), ('velocity', 'spin')  # where it moves


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
        """Yield the joints of a section; `names` are parameters. Raises InputError."""
        for item in repetition.repeated(section, self.fields, names):
            yield item, self.joint(item)

    def fields(self, entry: Entry) -> dict[str, Entry]:
        """The keys of a joint, which depend on its type."""
        if 'type' not in entry.mapping():
            keys = ['for', 'type', 'between', bearings.KEY]
            keys += _keys(each.keys for each in self.types.values())
            for dimension in (3, 2):
                keys += _keys(each.optional for each in joints.types(dimension).values())
            entry.mapping(tuple(dict.fromkeys(keys)), ('type',))
        each = entry.mapping()['type']
        kind = each.text()
        found = joints.find(kind, self.dimension)
        if found is None and joints.find(kind, 5 - self.dimension) is not None:
            where = 'space' if self.dimension == 2 else 'the plane'
            raise each.error(f'a joint of {where}', choices=self.types)
        if found is None:
            each.text(self.types)
        assert found is not None
        return entry.mapping(*_allowed(kind, self.dimension))

    def joint(self, item: Item) -> Joint:
        """A joint, by its type."""
        kind = item.fields['type'].text()
        found = joints.find(kind, self.dimension)
        assert found is not None
        given = GivenJoint(self, item, found)
        if not found.finds_body:
            given.parent, given.child = self.between(item.fields['between'], item)
            if found.on_ground and given.parent != GROUND:
                given.refuse_parent(f'{kind} is between the ground and a body')
        joint = found.read(given)
        if bearings.KEY in item.fields:
            entry = item.fields[bearings.KEY]
            bearing = bearings.read(entry, item.names, joint.kind, self.dimension)
            joint = replace(joint, bearing=bearing)
        return joint

    @cached_property
    def types(self) -> Mapping[str, JointType]:
        """All types of this dimension; imports them."""
        return joints.types(self.dimension)

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
        """The frame of a body as drawn; the world frame for the ground."""
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
            message = f'{" and ".join(bodies)} meet at {point}: name the one that slides'
            raise item.entry.error(message, expected=f'between: [ground, {bodies[0]}]')
        return bodies[0]

    def point(self, entry: Entry, item: Item) -> str:
        """The name of an existing point. Raises InputError."""
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

    def direction(self, entry: Entry, item: Item) -> tuple[Floats, str | None]:
        """A unit direction of the world as drawn, and the name of the vector if it is one."""
        if isinstance(entry.value, str):
            name = repetition.name(entry, item.names)
            if name not in self.vectors:
                expected = 'a list of numbers'
                raise entry.error('no such vector', value=name, expected=expected)
            return np.array(self.vectors[name].along), name
        return unit(entry, self.dimension, item.names), None


class GivenJoint:
    """A joint in the file, as its type sees it: `alf_ros.model.joints.contract.Given`."""

    def __init__(self, reader: JointReader, item: Item, kind: JointType) -> None:
        self._reader, self._item, self._type = reader, item, kind
        self.shares_point = kind.shares_point
        self.parent = self.child = GROUND

    def has(self, key: str) -> bool:
        return key in self._item.fields

    def error(self, key: str, message: str, n: int | None = None, **details: Any) -> InputError:
        return self._entry(key, n).error(message, **details)

    def point(self, key: str) -> str:
        return self._reader.point(self._entry(key), self._item)

    def points(self, key: str) -> tuple[str, str]:
        first, second = (
            self._reader.point(each, self._item) for each in self._entry(key).sequence(2)
        )
        return first, second

    def place(self, point: str) -> Numbers:
        return self._reader.points[point].at

    def is_fixed(self, point: str) -> bool:
        return self._reader.points[point].fixed

    def carries(self, body: str, point: str) -> bool:
        return self._reader.carries(body, point)

    def check_carries(self, key: str, point: str, body: str, n: int | None = None) -> None:
        self._reader.check_on(self._entry(key, n), point, body)

    def body(self, name: str) -> Body | None:
        return self._reader.bodies.get(name)

    def direction(self, key: str) -> tuple[Floats, str | None]:
        along, vector = self._reader.direction(self._entry(key), self._item)
        if vector is not None and not all(map(self._reader.has(vector), self._sides)):
            vector = None
        return along, vector

    def directions(self, key: str) -> tuple[Floats, Floats]:
        first, second = (
            self._reader.direction(each, self._item)[0] for each in self._entry(key).sequence(2)
        )
        return first, second

    def named_directions(self, key: str) -> dict[str, Floats]:
        entry, found = self._entry(key), dict[str, Floats]()
        for wanted, axis in entry.mapping().items():
            name = repetition.filled(wanted, axis, self._item.names)
            repetition.check_name(name, axis)
            found[name] = self._reader.direction(axis, self._item)[0]
        if len(found) != 3:
            expected = 'three names, each with a direction'
            raise entry.error('not three axes', value=', '.join(found), expected=expected)
        return found

    def number(self, key: str) -> float:
        return self._entry(key).number(self._item.names)

    def radius(self, key: str, n: int | None = None) -> float:
        entry = self._entry(key, n)
        radius = entry.number(self._item.names)
        if not radius > 0.0:
            raise entry.error('not a radius', expected='m, more than zero')
        return radius

    def boolean(self, key: str) -> bool:
        return self.has(key) and self._entry(key).boolean()

    def motion(self, key: str) -> tuple[Signal, ...]:
        return (self._entry(key).motion(self._item.names),) if self.has(key) else ()

    def surface(self, key: str, may_move: bool = True) -> Surface:
        reader, item = self._reader, self._item
        keys, moving = (LINE, MOVING_LINE) if reader.dimension == 2 else (PLANE, MOVING_PLANE)
        on = self._entry(key).mapping((*keys, *(moving if may_move else ())), keys)
        through = on['through'].vector(reader.dimension, item.names)
        along, _ = reader.direction(on[keys[1]], item)
        return Surface(through, along, _moving(on, frame_axes(along), item))

    def find_body(self, key: str, point: str) -> None:
        if not self.has('between'):
            self.parent, self.child = GROUND, self._reader.only_carrier(point, self._item)
            return
        self.parent, self.child = self._reader.between(self._entry('between'), self._item)
        if self.parent != GROUND:
            kind = self._item.fields['type'].text()
            self.refuse_parent(f'a {kind} is between the ground and a body')
        self.check_carries(key, point, self.child)

    def refuse_parent(self, message: str) -> NoReturn:
        """Raise an error if the parent should be the ground."""
        expected = f'[ground, {self.child}]'
        raise self.error('between', message, value=self.parent, expected=expected)

    def axes(self, along: Floats) -> Floats:
        return frame_axes(along)

    def frame(self, body: str, point: str, axes: Floats | None = None) -> Frame:
        return self._reader.frame(body, point, axes)

    def frame_at(self, body: str, place: Numbers, axes: Floats | None = None) -> Frame:
        return self._reader.at(body, place, axes)

    def joint(self, parent: Frame, child: Frame, **more: Any) -> Joint:
        item = self._item
        kind, frames = item.fields['type'].text(), (parent, child)
        freedoms = self._type.freedoms
        return Joint(item.name, kind, self.parent, self.child, frames, freedoms=freedoms, **more)

    @property
    def _sides(self) -> tuple[str, str]:
        return self.parent, self.child

    def _entry(self, key: str, n: int | None = None) -> Entry:
        if not key:
            return self._item.entry
        entry = self._item.fields[key]
        return entry if n is None else entry.sequence(2)[n]


@cache
def _allowed(kind: str, dimension: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The keys that a joint of this type may have, and those that it must have."""
    found = joints.find(kind, dimension)
    assert found is not None
    own = (*needed(found), *_keys([found.optional]))
    return ('for', 'type', 'between', bearings.KEY, *own), needed(found, between=True)


def needed(kind: JointType, between: bool = False) -> tuple[str, ...]:
    """The keys that a joint of this type must have, `between` among them if asked for."""
    first = ('between',) if between and not kind.finds_body else ()
    return (*first, *_keys([kind.keys]))


def _keys(groups: Iterable[tuple[Key, ...]]) -> list[str]:
    return [key.name for group in groups for key in group]


def _moving(on: Mapping[str, Entry], axes: Floats, item: Item) -> tuple[Signal, ...]:
    """How what a wheel rolls on moves, along its axes in rows; nothing if it does not."""
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


@remembered(1024)
def _kept(origin: Numbers, axes: tuple[Numbers, ...]) -> Frame:
    """A frame, of all bodies that are alike at once."""
    return Frame(origin, axes)


def unit(entry: Entry, dimension: int, names: Mapping[str, float]) -> Floats:
    """A direction, normalised; scaled first, so that no square over- or underflows."""
    d = np.array(entry.vector(dimension, names))
    scale = columns.real(columns.largest(np.abs(d)))
    if scale == 0.0:
        raise entry.error('zero is no direction')
    d = d / scale
    return np.asarray(d / columns.each(math.hypot, *d))


# the other axes of a frame turn by a right angle where this choice changes: at no direction that
# people write, so that directions beside one of these have the same choice
_PREFERRED = (0.0, 0.11, 0.23)


@remembered(1024)
def frame_axes(along: Floats) -> Floats:
    """Axes (rows) of which x in the plane, z in space is `along`."""
    if along.size == 2:
        return np.array([along, [-along[1], along[0]]])
    x = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along) + _PREFERRED))])
    x = x / columns.norm(x)
    return np.array([x, np.cross(along, x), along])

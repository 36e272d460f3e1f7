"""A mechanism file to a Mechanism: every key read, every mistake refused with its line.

What a mechanism as a whole must satisfy (pins closed once, nothing immovable) is in
mechanism_check.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from alf_ros import repetition
from alf_ros.document import Entry
from alf_ros.expression import reserved
from alf_ros.mechanism import GROUND, Body, Joint, Mechanism, Point
from alf_ros.mechanism_check import check
from alf_ros.mechanism_joints import JointReader
from alf_ros.repetition import Item

VERSION = 1
KEYS = ('alf', 'name', 'description', 'space', 'parameters', 'points', 'bodies', 'joints')
LATER = ('vectors', 'drives', 'constraints')
WORLD = 'world'
_COINCIDENT = 1e-12  # of the largest coordinate: closer points give no direction
_SHORTEST = 1e-100  # m: the square of less would vanish


@dataclass
class _Parts:
    """What has been read so far. `entries` tells where each name was declared, for errors."""

    points: dict[str, Point] = field(default_factory=dict)
    bodies: dict[str, Body] = field(default_factory=dict)
    entries: dict[str, Entry] = field(default_factory=dict)

    def declare(self, item: Item) -> None:
        """Points, bodies and joints share one set of names: topics, frames and columns use it."""
        name, entry = item.name, item.entry
        if not repetition.NAME.fullmatch(name):
            expected = 'a letter, then letters, digits or _, 100 at most'
            raise entry.error('not a name', value=name, expected=expected)
        if name in (GROUND, WORLD):
            raise entry.error('this name is taken by the frame of the world', value=name)
        if name in self.entries:
            first = self.entries[name]
            line = f' in line {first.line}' if first.line else ''
            raise entry.error(f'this name is already that of {first.path}{line}', value=name)
        self.entries[name] = entry


def read_mechanism(
    root: Entry, name: str, overrides: Mapping[str, Entry]
) -> tuple[Mechanism, dict[str, float]]:
    """The mechanism and the values of its parameters, of which `overrides` replaces some.

    `name` is used if the file gives none. Raises InputError.
    """
    for key in LATER:
        if key in root.mapping():
            raise root.mapping()[key].error(f'{key} are not supported in this version')
    fields = root.mapping(KEYS, ('alf', 'points', 'bodies'))
    if fields['alf'].integer({}) != VERSION:
        raise fields['alf'].error('unknown version of the format', expected=str(VERSION))
    if 'space' in fields and fields['space'].text(('planar', 'spatial')) != 'planar':
        raise fields['space'].error('planar only in this version', expected='planar')
    if 'name' in fields:
        name = repetition.title(fields['name'])
    values = read_parameters(fields.get('parameters'), overrides)
    parts = _Parts()
    for point in _points(fields['points'], values, parts):
        parts.points[point.name] = point
    for body in _bodies(fields['bodies'], values, parts):
        parts.bodies[body.name] = body
    if not parts.bodies:
        raise fields['bodies'].error('a mechanism needs a body')
    joints: list[Joint] = []
    if 'joints' in fields:
        reader = JointReader(parts.points, parts.bodies)
        for item, joint in reader.read(fields['joints'], values):
            parts.declare(item)
            joints.append(joint)
    points, bodies = tuple(parts.points.values()), tuple(parts.bodies.values())
    mechanism = Mechanism(name, points, bodies, tuple(joints))
    check(mechanism, parts.entries)
    return mechanism, values


def read_parameters(section: Entry | None, overrides: Mapping[str, Entry]) -> dict[str, float]:
    """Values in order; each may use those before it."""
    own = {} if section is None else section.mapping()
    for key, entry in overrides.items():
        if key not in own:
            raise entry.error('no such parameter of the mechanism', value=key, choices=own)
    values: dict[str, float] = {}
    for key, entry in own.items():
        if not repetition.NAME.fullmatch(key) or reserved(key):
            raise entry.error('this name cannot be that of a parameter', value=key)
        values[key] = overrides.get(key, entry).number(values)
    return values


def _points(section: Entry, values: Mapping[str, float], parts: _Parts) -> Iterator[Point]:
    for item in repetition.repeated(section, ('at', 'fixed'), ('at',), values):
        parts.declare(item)
        fixed = 'fixed' in item.fields and item.fields['fixed'].boolean()
        yield Point(item.name, item.fields['at'].vector(2, item.names), fixed)


def _bodies(section: Entry, values: Mapping[str, float], parts: _Parts) -> Iterator[Body]:
    keys = ('points', 'mass', 'inertia', 'com', 'length')
    for item in repetition.repeated(section, keys, ('points', 'mass'), values):
        parts.declare(item)
        points = _references(item, 'points', parts)
        local = _local(item, [parts.points[p].at for p in points])
        mass = item.fields['mass'].number(item.names)
        if mass < 0.0:
            raise item.fields['mass'].error('negative mass', expected='kg, zero or more')
        com, inertia = _inertia(item, local, mass)
        yield Body(item.name, points, local, mass, com, inertia)


def _references(item: Item, key: str, parts: _Parts) -> tuple[str, ...]:
    """Distinct points of a body, at least one."""
    names: list[str] = []
    for entry in item.fields[key].sequence():
        name = repetition.name(entry, item.names)
        if name not in parts.points:
            raise entry.error('no such point', value=name, choices=parts.points)
        if name in names:
            raise entry.error('point given twice', value=name)
        names.append(name)
    if not names:
        raise item.fields[key].error(f'body {item.name!r} has no points')
    return tuple(names)


def _local(item: Item, drawn: list[tuple[float, ...]]) -> tuple[tuple[float, ...], ...]:
    """The points in the body frame (m): origin at the first, x axis towards the second."""
    length = item.fields.get('length')
    if length is not None and len(drawn) != 2:
        raise length.error('a length is for bodies of two points')
    if len(drawn) == 1:
        return ((0.0, 0.0),)
    (x, y), (x1, y1) = drawn[:2]
    span = math.hypot(x1 - x, y1 - y)
    if span <= max(_COINCIDENT * max(map(abs, (x, y, x1, y1))), _SHORTEST):
        raise item.fields['points'].error(
            f'the first two points of {item.name!r} are drawn at the same place'
        )
    cos, sin = (x1 - x) / span, (y1 - y) / span
    if length is not None:
        span = length.number(item.names)
        if span < _SHORTEST:
            raise length.error('not a length', expected='m, more than zero')
    further = (
        (cos * (a - x) + sin * (b - y), cos * (b - y) - sin * (a - x)) for a, b in drawn[2:]
    )
    return ((0.0, 0.0), (span, 0.0), *further)


def _inertia(
    item: Item, local: tuple[tuple[float, ...], ...], mass: float
) -> tuple[tuple[float, ...], float]:
    """Centre of mass in the body frame (m) and inertia about it (kg m²)."""
    kind, inertia = _moment(item, local, mass)
    centre = item.fields.get('com')
    com = None if centre is None else centre.vector(2, item.names)
    if len(local) == 1:
        if kind == 'rod' or inertia > 0.0:
            raise item.fields['inertia'].error(
                f'body {item.name!r} has one point, which cannot turn', expected='point'
            )
        if centre is not None and com != (0.0, 0.0):
            raise centre.error('a body of one point has its mass there', expected='[0, 0]')
        return (0.0, 0.0), 0.0
    if com is not None:
        return com, inertia
    if kind == 'rod' or mass == 0.0 or (kind == 'about_com' and len(local) == 2):
        return (0.5 * local[1][0], 0.0), inertia
    raise item.entry.error(f"missing key 'com': where is the mass of {item.name!r}?")


def _moment(item: Item, local: tuple[tuple[float, ...], ...], mass: float) -> tuple[str, float]:
    """What `inertia` says: 'rod', 'point' or 'about_com', and its value (kg m²)."""
    entry = item.fields.get('inertia')
    if entry is None:
        if mass > 0.0:
            raise item.entry.error(f"missing key 'inertia': {item.name!r} has a mass")
        return 'point', 0.0
    if isinstance(entry.value, dict):
        about = entry.mapping(('about_com',), ('about_com',))['about_com']
        inertia = about.number(item.names)
        if inertia < 0.0:
            raise about.error('negative inertia', expected='kg m^2, zero or more')
        return 'about_com', inertia
    if entry.value not in ('rod', 'point'):
        raise entry.error('unknown inertia', expected='rod, point or {about_com: J}')
    length = local[1][0] if entry.value == 'rod' and len(local) > 1 else 0.0
    return str(entry.value), mass * length * length / 12.0

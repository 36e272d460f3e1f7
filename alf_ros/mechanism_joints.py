"""The `joints` of a mechanism file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from alf_ros import repetition
from alf_ros.document import Entry
from alf_ros.mechanism import GROUND, Body, Joint, Point
from alf_ros.repetition import Item

TYPES = ('revolute', 'slider')
LATER = (
    'prismatic',
    'weld',
    'gear',
    'spherical',
    'universal',
    'cylindrical',
    'planar',
    'no_slip',
    'rolling',
    'blade',
)


class JointReader:
    """Reads joints between the bodies and at the points that exist. Raises InputError."""

    def __init__(self, points: Mapping[str, Point], bodies: Mapping[str, Body]) -> None:
        self.points, self.bodies = points, bodies
        self.carriers: dict[str, list[str]] = {name: [] for name in points}
        for body in bodies.values():
            for point in body.points:
                self.carriers[point].append(body.name)

    def read(self, section: Entry, names: Mapping[str, float]) -> Iterator[tuple[Item, Joint]]:
        keys = ('type', 'between', 'at', 'point', 'on')
        for item in repetition.repeated(section, keys, ('type',), names):
            kind = item.fields['type']
            if kind.text() in LATER:
                raise kind.error('not supported in this version', expected=' or '.join(TYPES))
            revolute = kind.text(TYPES) == 'revolute'
            yield item, self.revolute(item) if revolute else self.slider(item)

    def revolute(self, item: Item) -> Joint:
        fields = item.entry.mapping(('for', 'type', 'between', 'at'), ('between', 'at'))
        point = self.point(fields['at'], item)
        parent, child = self.between(fields['between'], item)
        for body in (parent, child):
            self.check_on(fields['at'], point, body)
        return Joint(item.name, 'revolute', parent, child, point)

    def slider(self, item: Item) -> Joint:
        fields = item.entry.mapping(('for', 'type', 'point', 'on', 'between'), ('point', 'on'))
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
        line = fields['on'].mapping(('through', 'direction'), ('through', 'direction'))
        through = line['through'].vector(2, item.names)
        direction = _unit(line['direction'], item.names)
        return Joint(item.name, 'slider', GROUND, child, point, through, direction)

    def only_carrier(self, point: str, item: Item) -> str:
        """The body on a slider whose file names none."""
        bodies = self.carriers[point]
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


def _unit(entry: Entry, names: Mapping[str, float]) -> tuple[float, float]:
    """A direction, normalised; scaled first, so that no square over- or underflows."""
    x, y = entry.vector(2, names)
    scale = max(abs(x), abs(y))
    if scale == 0.0:
        raise entry.error('zero is no direction')
    x, y = x / scale, y / scale
    norm = math.hypot(x, y)
    return x / norm, y / norm

"""The `drives` of a mechanism file: what moves as a function of time.

A motion is an expression of t, or a table of times and values: a cubic spline that begins and ends
at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alf_ros.mechanism import GROUND, Coordinate, Drive, Mechanism, time_function
from alf_ros.mechanism.natural_coordinates import cut
from alf_ros.mechanism.time_function import Signal
from alf_ros.scene.references import References
from alf_ros.scene.text import repetition
from alf_ros.scene.text.number_table import Tables
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry

KEYS = ('joint', 'angle', 'length', 'point', 'at', 'points')
OF = {'joint': ('angle', 'length'), 'point': ('at',), 'points': ('length',)}


class DriveReader:
    """Reads drives of what a mechanism has. Raises InputError."""

    def __init__(self, mechanism: Mechanism, references: References) -> None:
        self.mechanism, self.tables = mechanism, Tables(references)
        self.driven: set[tuple[str, ...]] = set()
        self.layout = cut(mechanism)
        self.coordinates = mechanism.coordinate
        self.points = {point.name: point for point in mechanism.points}

    def read(self, section: Entry, names: Mapping[str, float]) -> Iterator[tuple[Item, Drive]]:
        """Yield the drives of a section; `names` are parameters. Raises InputError."""
        for item in repetition.repeated(section, _fields, names):
            what = next(key for key in OF if key in item.fields)
            how = next(key for key in OF[what] if key in item.fields)
            read = {'joint': self.of_joint, 'point': self.of_point, 'points': self.of_points}
            drive = read[what](item, how)
            if drive.of in self.driven:
                raise item.fields[what].error('driven twice', value=' '.join(drive.of))
            self.driven.add(drive.of)
            yield item, drive

    def of_joint(self, item: Item, how: str) -> Drive:
        """A drive of the 'angle' (rad) or 'length' (m) of a joint. Raises InputError."""
        entry = item.fields['joint']
        name = repetition.name(entry, item.names)
        if name not in self.coordinates:
            raise entry.error('no such joint coordinate', value=name, choices=self.coordinates)
        coordinate = self.coordinates[name]
        fits = 'angle' if coordinate.is_angle else 'length'
        if how != fits:
            raise item.fields[how].error(f'the coordinate of {name!r} is no {how}', expected=fits)
        if coordinate.is_angle and not self.layout.turns(coordinate.joint.child):
            child = coordinate.joint.child
            raise entry.error(f'body {child!r} has one point only, which cannot turn')
        motion = self.motions(item.fields[how], item, 1)
        return Drive(item.name, how, (name,), motion, _from_ground(coordinate))

    def of_points(self, item: Item, how: str) -> Drive:
        """A drive of the distance (m) of two points. Raises InputError."""
        ends = item.fields['points'].sequence(2)
        names = tuple(self.point(end, item) for end in ends)
        if all(self.points[name].fixed for name in names):
            raise item.fields['points'].error('both points are fixed')
        if names[0] == names[1]:
            raise item.fields['points'].error('a distance is between two points')
        return Drive(item.name, 'distance', names, self.motions(item.fields[how], item, 1))

    def of_point(self, item: Item, how: str) -> Drive:
        """A drive of the position (m) of a movable point. Raises InputError."""
        name = self.point(item.fields['point'], item)
        if self.points[name].fixed:
            raise item.fields['point'].error('this point is fixed', value=name)
        motion = self.motions(item.fields[how], item, self.mechanism.dimension)
        return Drive(item.name, 'point', (name,), motion)

    def point(self, entry: Entry, item: Item) -> str:
        """The name of an existing point. Raises InputError."""
        name = repetition.name(entry, item.names)
        if name not in self.points:
            raise entry.error('no such point', value=name, choices=self.points)
        return name

    def motions(self, entry: Entry, item: Item, count: int) -> tuple[Signal | None, ...]:
        """An expression (of a point a list of them, null where it is free), or {table: rows}."""
        if isinstance(entry.value, dict):
            rows = entry.mapping(('table',), ('table',))['table']
            table = self.tables.table(rows, item.names)
            if len(table[0]) != 1 + count:
                raise rows.error(f'a table of {len(table[0])} columns', expected=f'{1 + count}')
            try:
                columns = range(1, 1 + count)
                return tuple(
                    time_function.table([(row[0], row[n]) for row in table]) for n in columns
                )
            except ValueError as error:
                raise rows.error(str(error)) from None
        if isinstance(entry.value, str) and entry.value.lower().endswith('.csv'):
            raise entry.error('a file', expected=f'{{table: {entry.value}}}')
        if count > 1:
            each = entry.sequence(count)
            if all(one.is_null for one in each):
                raise entry.error('drives nothing', expected='an expression on one axis at least')
            return tuple(None if one.is_null else one.motion(item.names) for one in each)
        return (entry.motion(item.names),)


def _fields(entry: Entry) -> dict[str, Entry]:
    """The keys of a drive: what it drives says which motion there is."""
    fields = entry.mapping(('for', *KEYS))
    what = [key for key in OF if key in fields]
    if len(what) != 1:
        raise entry.error(
            'the driven joint or point is missing', expected='one of joint, point and points'
        )
    fields = entry.mapping(('for', what[0], *OF[what[0]]))
    if sum(key in fields for key in OF[what[0]]) != 1:
        raise entry.error('no motion', expected=' or '.join(OF[what[0]]))
    return fields


def _from_ground(coordinate: Coordinate) -> bool:
    """Whether an angle is measured from axes of the ground."""
    joint = coordinate.joint
    return joint.parent == GROUND and coordinate.name != f'{joint.name}_second'

"""A mechanism file to a Mechanism: every key read, every mistake refused with its line.

`topology_check` has the conditions for a mechanism as a whole (pins closed once, no immovable
body).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from alf_ros import columns
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND, Body, Coupling, Drive, Joint, Mechanism, Point, Vector
from alf_ros.mechanism.natural_coordinates import Layout, cut
from alf_ros.scene.mechanism_file import couplings
from alf_ros.scene.mechanism_file.bodies import BodyReader
from alf_ros.scene.mechanism_file.drives import DriveReader
from alf_ros.scene.mechanism_file.joints import JointReader, unit
from alf_ros.scene.mechanism_file.orientation_vectors import orient
from alf_ros.scene.mechanism_file.shapes_section import KEY as SHAPES
from alf_ros.scene.mechanism_file.shapes_section import ShapeReader
from alf_ros.scene.mechanism_file.topology_check import check
from alf_ros.scene.references import References
from alf_ros.scene.text import repetition
from alf_ros.scene.text.expression import reserved
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry, replaced

VERSION = 1
KEYS = (
    'alf',
    'name',
    'description',
    'space',
    'parameters',
    'points',
    'vectors',
    'bodies',
    'joints',
    'couplings',
    'drives',
    SHAPES,
)
REQUIRED = ('alf', 'points', 'bodies')
SPACES = ('planar', 'spatial')
POINT = ('at', 'fixed')  # the first is required
VECTOR = ('along', 'fixed')  # likewise
WORLD = 'world'


@dataclass
class Parts:
    """The parts read so far. `entries` gives the place of each declaration, for errors."""

    points: dict[str, Point] = field(default_factory=dict)
    vectors: dict[str, Vector] = field(default_factory=dict)
    bodies: dict[str, Body] = field(default_factory=dict)
    entries: dict[str, Entry] = field(default_factory=dict)

    def declare(self, item: Item) -> None:
        """Points, vectors, bodies and joints share one set of names, as topics and frames do."""
        name, entry = item.name, item.entry
        repetition.check_name(name, entry)
        if name in (GROUND, WORLD):
            raise entry.error('this name is taken by the frame of the world', value=name)
        if name in self.entries:
            first = self.entries[name]
            line = f' in line {first.line}' if first.line else ''
            raise entry.error(f'this name already belongs to {first.path}{line}', value=name)
        self.entries[name] = entry


class MechanismFound(NamedTuple):
    """A mechanism, cut, the values of its parameters, and the entry without references to
    files."""

    layout: Layout
    values: dict[str, float]
    root: Entry
    drives: Entry | None


def read_mechanism(
    root: Entry,
    name: str,
    overrides: Mapping[str, Entry],
    references: References,
    drives: Entry | None = None,
) -> MechanismFound:
    """The mechanism in `root`, of whose parameters `overrides` replaces some; with the `drives` of
    a scene besides its own.

    `name` is used if the file gives none. Raises InputError.
    """
    fields = root.mapping(KEYS, REQUIRED)
    if fields['alf'].integer({}) != VERSION:
        raise fields['alf'].error('unknown version of the format', expected=str(VERSION))
    spatial = 'space' in fields and fields['space'].text(SPACES) == 'spatial'
    dimension = 3 if spatial else 2
    if 'vectors' in fields and not spatial:
        raise fields['vectors'].error('vectors are for space: spatial')
    if 'name' in fields:
        name = repetition.title(fields['name'])
    values = read_parameters(fields.get('parameters'), overrides)
    shapes = ShapeReader(dimension, references)
    mechanism, parts = read_parts(fields, name, values, dimension, shapes)
    coupled: list[Coupling] = []
    root = replaced(root, shapes.named)
    if 'couplings' in fields:
        for item, coupling in couplings.read(fields['couplings'], mechanism, values):
            parts.declare(item)
            coupled.append(coupling)
        mechanism = replace(mechanism, couplings=tuple(coupled))
    if 'drives' in fields or drives is not None:
        reader = DriveReader(mechanism, references)
        found: list[Drive] = []
        for section in (fields.get('drives'), drives):
            for item, drive in reader.read(section, values) if section is not None else ():
                parts.declare(item)
                found.append(drive)
        mechanism = replace(mechanism, drives=tuple(found))
        root = reader.tables.without_files(root)
        drives = drives and reader.tables.without_files(drives)
    layout = cut(mechanism)
    check(layout, parts.entries)
    return MechanismFound(layout, values, root, drives)


def read_parts(
    fields: Mapping[str, Entry],
    name: str,
    values: Mapping[str, float],
    dimension: int,
    shapes: ShapeReader,
) -> tuple[Mechanism, Parts]:
    """The mechanism in the fields of a file, without couplings and drives, and where its parts are
    declared. Raises InputError."""
    parts = Parts()
    for point in _points(fields['points'], values, parts, dimension):
        parts.points[point.name] = point
    if 'vectors' in fields:
        for vector in _vectors(fields['vectors'], values, parts):
            parts.vectors[vector.name] = vector
    bodies = BodyReader(parts.points, parts.vectors, dimension, shapes)
    for item, body in bodies.read(fields['bodies'], values):
        parts.declare(item)
        parts.bodies[body.name] = body
    if not parts.bodies:
        raise fields['bodies'].error('a mechanism needs a body')
    joints: list[Joint] = []
    if 'joints' in fields:
        joint_reader = JointReader(
            parts.points, parts.vectors, parts.bodies, bodies.poses, dimension
        )
        for item, joint in joint_reader.read(fields['joints'], values):
            parts.declare(item)
            joints.append(joint)
    if dimension == 3:
        orient(parts.bodies, parts.vectors, bodies.poses, joints, parts.entries)
    mechanism = Mechanism(
        name,
        tuple(parts.points.values()),
        tuple(parts.bodies.values()),
        tuple(joints),
        tuple(parts.vectors.values()),
        dimension,
        shapes=shapes.read(fields[SHAPES], values) if SHAPES in fields else (),
    )
    _check_coordinates(mechanism, parts)
    return mechanism, parts


def _check_coordinates(mechanism: Mechanism, parts: Parts) -> None:
    """Refuse a name of two joint coordinates, such as of a `universal` u and another joint
    u_first: commands and joint states are by these names."""
    named = [(each.name, each.joint) for each in mechanism.coordinates]
    named += [(name, joint) for joint in mechanism.joints for name in joint.angles]
    owners: dict[str, Joint] = {}
    for name, joint in named:
        other = owners.setdefault(name, joint)
        if other is not joint:
            message = f'a coordinate of {other.name} has the same name as one of this joint'
            raise parts.entries[joint.name].error(message, value=name)


def read_parameters(section: Entry | None, overrides: Mapping[str, Entry]) -> dict[str, float]:
    """Values in order; each may use those before it."""
    own = {} if section is None else section.mapping()
    for key, entry in overrides.items():
        if key not in own:
            raise entry.error('no such parameter of the mechanism', value=key, choices=own)
    values: dict[str, float] = {}
    for key, entry in own.items():
        if not repetition.NAME.fullmatch(key) or reserved(key):
            raise entry.error('this name cannot be used for a parameter', value=key)
        given = overrides.get(key, entry)
        try:
            values[key] = given.number(values)
        except InputError as error:
            if error.value in values or error.value not in own:
                raise
            what = 'uses itself' if error.value == key else 'uses a parameter further below'
            expected = 'parameters that stand above it'
            raise given.error(what, value=error.value, expected=expected) from None
    return values


def _points(
    section: Entry, values: Mapping[str, float], parts: Parts, dimension: int
) -> Iterator[Point]:
    for item in repetition.repeated(section, repetition.keys(POINT, POINT[:1]), values):
        parts.declare(item)
        at = item.fields['at'].vector(dimension, item.names)
        yield Point(item.name, at, _fixed(item))


def _vectors(section: Entry, values: Mapping[str, float], parts: Parts) -> Iterator[Vector]:
    for item in repetition.repeated(section, repetition.keys(VECTOR, VECTOR[:1]), values):
        parts.declare(item)
        along = unit(item.fields['along'], 3, item.names)
        yield Vector(item.name, tuple(map(columns.real, along)), _fixed(item))


def _fixed(item: Item) -> bool:
    return 'fixed' in item.fields and item.fields['fixed'].boolean()

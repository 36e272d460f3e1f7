"""A robot as the text of a mechanism or scene file.

Each connection is at a point of the child, which the parent shares where nothing slides; a body
that has no other gets one at its origin. Bodies are written in the frame that the loader will give
them: origin at the first point, x axis towards the second.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange import effect_entries
from alf_ros.exchange.effect_entries import Named
from alf_ros.exchange.robot import GROUND, Connection, FramePose, Robot, RobotPart
from alf_ros.exchange.visuals import moved, shape_fields
from alf_ros.mechanism import GROUND as GROUND_IN_FILES
from alf_ros.model import joints
from alf_ros.scene.mechanism_file.bodies import frame_axes
from alf_ros.scene.text.repetition import NAME
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.scene.text.yaml_writer import entry, serialise

_SAME = 1e-9  # of the robot's size: places closer than that are one
_OF_BODY = ('_x', '_y', '_z', '_length')  # the loader's names of what orients a body, and of a row


class _Names:
    """Names that files allow, one for each thing; what had to be renamed is noted."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._taken = robot, {GROUND_IN_FILES, 'world'}

    def take(self, wanted: str, suffixes: Sequence[str] = (), note: bool = True) -> str:
        """A name like the one wanted, that is free with each of the suffixes as well."""
        stem = re.sub(r'[^A-Za-z0-9_]', '_', wanted)[:80]
        stem = stem if NAME.fullmatch(stem) else f'n_{stem}'
        name, n = stem, 2
        while not self._taken.isdisjoint(own := {name + each for each in ('', *suffixes)}):
            name, n = f'{stem}_{n}', n + 1
        self._taken |= own
        if note and name != wanted:
            self._robot.leave('names, changed', f'{wanted} is {name}')
        return name


class _Points:
    """Places of bodies; those that a joint holds together are shared."""

    def __init__(self, robot: Robot, names: _Names) -> None:
        self.size = robot.size
        self.at: dict[str, Floats] = {}
        self.fixed: set[str] = set()
        self.of: dict[str, list[str]] = {part.name: [] for part in robot.parts}
        self._names = names
        self._held: dict[str, set[str]] = {}  # the bodies that joints connect at a point

    def new(self, name: str, place: Floats, bodies: Iterable[str]) -> str:
        """A point that these bodies carry."""
        name = self._names.take(name, note=False)
        self.at[name], self._held[name] = place, set()
        for body in bodies:
            self.add(name, body)
        return name

    def add(self, point: str, body: str) -> None:
        self._held[point].add(body)
        if body == GROUND:
            self.fixed.add(point)
        elif point not in self.of[body]:
            self.of[body].append(point)

    def of_joint(self, connection: Connection, name: str) -> str:
        """The point at which a connection is."""
        parent, child = connection.parent, connection.child
        kind = joints.find(connection.kind, 3)
        if kind is None or not kind.shares_point:
            return self.new(f'{name}_at', connection.place, [child])
        near = [point for point in self.at if self._near(point, connection.place)]
        of_parent, of_child = (
            [point for point in near if body in self._held[point]] for body in (parent, child)
        )
        if not of_parent and not of_child:
            return self.new(f'{name}_at', connection.place, [parent, child])
        if not of_parent or not of_child:
            point = (of_parent or of_child)[0]
            self.add(point, parent)
            self.add(point, child)
            return point
        # both are there already: one that they share would close a circle of joints at one point,
        # so rows hold the joint at a point of one side
        alone = [point for point in of_parent if point not in of_child]
        return alone[0] if alone else self.new(f'{name}_at', connection.place, [child])

    def _near(self, point: str, place: Floats) -> bool:
        return bool(np.linalg.norm(self.at[point] - place) <= _SAME * self.size)

    def ordered(self, body: str) -> list[str]:
        """The points of a body: the second is elsewhere than the first, for the body's x axis
        goes there. If all are at one place the body gets another, at a length of the robot."""
        first, *others = self.of[body]
        away = [p for p in others if not self._near(p, self.at[first])]
        if others and not away:
            aside = self.at[first] + np.array([self.size or 1.0, 0.0, 0.0])
            away = [self.new(f'{first}_aside', aside, [body])]
            others = self.of[body][1:]
        return [first, *away[:1], *(p for p in others if p not in away[:1])]


def text(
    robot: Robot, scene: bool, stops: float | None, version: str, contact: float | None = None
) -> str:
    """The mechanism file of a robot; a `scene` also has its effects.

    stops: stiffness of a `joint_stop` at each limit of a joint, N m/rad^1.5 or N/m^1.5. contact:
    stiffness of a `ground_contact` of each ball that touches a plane, N/m^1.5.
    """
    names = _Names(robot)
    joints = {c.name: names.take(c.name, _of_coordinates(c.kind)) for c in robot.connections}
    bodies = {part.name: names.take(part.name, _OF_BODY) for part in robot.parts}
    bodies[GROUND] = GROUND_IN_FILES
    points = _Points(robot, names)
    found: dict[str, dict[str, Any]] = {}
    for c in robot.connections:
        at = points.of_joint(c, joints[c.name])
        sides = [bodies[c.parent], bodies[c.child]]
        axes = [_numbers(axis, 1.0) for axis in c.axes]
        along: dict[str, Any] = {'axis': axes[0]} if len(axes) == 1 else {'axes': axes}
        found[joints[c.name]] = {'type': c.kind, 'between': sides, 'at': at}
        found[joints[c.name]] |= along if axes else {}
        if c.start is not None:
            start = points.new(f'{joints[c.name]}_start', c.start, [c.parent])
            found[joints[c.name]] = {'type': c.kind, 'between': sides, 'points': [start, at]}
            found[joints[c.name]]['length'] = c.length
        if c.angles:
            found[joints[c.name]]['angles'] = {
                joints[c.name] if name == c.name else names.take(name): _numbers(axis, 1.0)
                for name, axis in c.angles
            }
        if c.kind == 'screw':
            found[joints[c.name]]['pitch'] = c.pitch
    for part in robot.parts:
        if not points.of[part.name]:
            points.new(f'{bodies[part.name]}_at', part.origin, [part.name])
    carried = {part.name: points.ordered(part.name) for part in robot.parts}
    mechanism: dict[str, Any] = {
        'alf': 1,
        'name': re.sub(r'[^A-Za-z0-9_.-]', '_', robot.name)[:100] or 'robot',
        'space': 'spatial',
        'points': {
            name: {'at': _numbers(place, points.size)}
            | ({'fixed': Entry('true')} if name in points.fixed else {})
            for name, place in points.at.items()
        },
        'bodies': {
            bodies[part.name]: _body(part, points, carried[part.name]) for part in robot.parts
        },
        'joints': found,
    }
    _add_shapes(robot, mechanism, bodies, points, carried)
    if robot.couplings:
        mechanism['couplings'] = {
            names.take(each.name): {'joints': {joints[name]: a for name, a in each.of.items()}}
            for each in robot.couplings
        }
    whole = mechanism
    if scene:
        frames = {
            part.name: FramePose(first, axes.T)
            for part in robot.parts
            for first, axes in [_frame(points, carried[part.name])]
        }
        named = Named(joints, bodies, frames)
        whole = {
            'mechanism': mechanism,
            'effects': effect_entries.entries(robot, named, stops, contact),
        }
    else:
        effect_entries.leave(robot)
    if stops is None:
        for c in (each for whole in robot.connections for _, each in whole.coordinates()):
            if c.limits is not None:
                robot.leave('limits (see --stops)', c.name)
        for tendon in robot.tendons:
            if tendon.limits is not None:
                robot.leave('limits (see --stops)', tendon.name)
    if contact is None:
        for each in robot.touches:
            robot.leave('contact with the ground (see --contact)', each.part)
    return _head(robot, version) + serialise(entry(whole))


def _of_coordinates(kind: str) -> list[str]:
    """The suffixes of the coordinates of a joint that has several."""
    found = joints.find(kind, 3)
    freedoms = () if found is None else found.freedoms
    return [f'_{each.suffix}' for each in freedoms] if len(freedoms) > 1 else []


def _body(part: RobotPart, points: _Points, carried: list[str]) -> dict[str, Any]:
    fields: dict[str, Any] = {'points': carried, 'mass': part.mass}
    if part.mass == 0.0:
        return fields
    first, axes = _frame(points, carried)
    J = axes @ part.inertia @ axes.T
    size = float(np.abs(J).max())
    moments = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    fields['inertia'] = {'about_com': _numbers(np.array(moments), size)}
    fields['com'] = _numbers(axes @ (part.com - first), points.size)
    return fields


def _frame(points: _Points, carried: list[str]) -> tuple[Floats, Floats]:
    """The frame that the loader gives a body: origin (3,), axes (3, 3) in rows."""
    first, *others = (points.at[name] for name in carried)
    return first, frame_axes(np.array([place - first for place in others]).reshape(-1, 3))


def _add_shapes(
    robot: Robot,
    mechanism: dict[str, Any],
    bodies: dict[str, str],
    points: _Points,
    carried: dict[str, list[str]],
) -> None:
    """Write the shapes of the ground and of bodies, in their frames."""
    for part, shape in robot.shapes:
        if part == GROUND:
            mechanism.setdefault('shapes', []).append(shape_fields(shape))
        elif part in carried:
            first, axes = _frame(points, carried[part])
            found = moved(shape, FramePose(first, axes.T).inverse)
            mechanism['bodies'][bodies[part]].setdefault('shapes', []).append(shape_fields(found))
        else:
            robot.leave('shapes', part)


def _numbers(values: Floats, size: float) -> list[float]:
    """Values, with rounding set to zero."""
    return [0.0 if abs(x) < 1e-15 * size else float(x) for x in values]


def _head(robot: Robot, version: str) -> str:
    """Where it came from, and what did not come along."""
    lines = [f'Imported from {robot.file} by alf_ros {version}.', *robot.left_out.lines()]
    clean = (re.sub(r'[^\x20-\x7e\xa0-\ud7ff]', '?', line) for line in lines)
    return ''.join(f'# {line}\n' for line in clean)

"""A robot as the text of a mechanism or scene file.

Each connection is at a point of the child, which the parent shares where nothing slides; a body
that has no other gets one at its origin. Bodies are told in the frame that the loader will give
them: origin at the first point, x axis towards the second.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import Connection, Part, Robot
from alf_ros.mechanism import GROUND
from alf_ros.model import joints
from alf_ros.scene.mechanism_file.bodies import frame_axes
from alf_ros.scene.text.repetition import NAME
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.scene.text.yaml_writer import entry, serialise

_SAME = 1e-9  # of the robot's size: places closer than that are one


class _Names:
    """Names that files allow, one for each thing; what had to be renamed is noted."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._taken = robot, {GROUND, 'world'}

    def take(self, wanted: str, note: bool = True) -> str:
        stem = re.sub(r'[^A-Za-z0-9_]', '_', wanted)[:90]
        stem = stem if NAME.fullmatch(stem) else f'n_{stem}'
        name, n = stem, 2
        while name in self._taken:
            name, n = f'{stem}_{n}', n + 1
        self._taken.add(name)
        if note and name != wanted:
            self._robot.leave('names, changed', f'{wanted} is {name}')
        return name


class _Points:
    """Places of bodies; those that a joint holds together are shared."""

    def __init__(self, robot: Robot, names: _Names) -> None:
        places = [*(c.place for c in robot.connections), *(part.origin for part in robot.parts)]
        self.size = max((float(np.abs(place).max()) for place in places), default=0.0)
        self.at: dict[str, Floats] = {}
        self.fixed: set[str] = set()
        self.of: dict[str, list[str]] = {part.name: [] for part in robot.parts}
        self._names = names
        self._held: dict[str, set[str]] = {}  # the bodies that joints connect at a point

    def new(self, name: str, place: Floats, bodies: Iterable[str]) -> str:
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
        for point, bodies in self._held.items():
            # one that both have would close a circle of joints at one point
            near = np.linalg.norm(self.at[point] - connection.place) <= _SAME * self.size
            if near and (parent in bodies) != (child in bodies):
                self.add(point, parent)
                self.add(point, child)
                return point
        return self.new(f'{name}_at', connection.place, [parent, child])


def text(robot: Robot, scene: bool, stops: float | None, version: str) -> str:
    """The mechanism file of a robot; a `scene` has in it also what acts on it.

    stops: stiffness of a `joint_stop` at each limit of a joint, N m/rad^1.5 or N/m^1.5.
    """
    names = _Names(robot)
    joints = {c.name: names.take(c.name) for c in robot.connections}
    bodies = {part.name: names.take(part.name) for part in robot.parts}
    bodies[GROUND] = GROUND
    points = _Points(robot, names)
    found = {}
    for c in robot.connections:
        at = points.of_joint(c, joints[c.name])
        sides = [bodies[c.parent], bodies[c.child]]
        axes = [_numbers(axis, 1.0) for axis in c.axes]
        along: dict[str, Any] = {'axis': axes[0]} if len(axes) == 1 else {'axes': axes}
        found[joints[c.name]] = {'type': c.kind, 'between': sides, 'at': at}
        found[joints[c.name]] |= along if axes else {}
    for part in robot.parts:
        if not points.of[part.name]:
            points.new(f'{bodies[part.name]}_at', part.origin, [part.name])
    mechanism: dict[str, Any] = {
        'alf': 1,
        'name': re.sub(r'[^A-Za-z0-9_.-]', '_', robot.name)[:100] or 'robot',
        'space': 'spatial',
        'points': {
            name: {'at': _numbers(place, points.size)}
            | ({'fixed': Entry('true')} if name in points.fixed else {})
            for name, place in points.at.items()
        },
        'bodies': {bodies[part.name]: _body(part, points) for part in robot.parts},
        'joints': found,
    }
    whole = mechanism
    if scene:
        whole = {'mechanism': mechanism, 'effects': _effects(robot, joints, stops)}
    else:
        _leave_effects(robot)
    if stops is None:
        for c in robot.connections:
            if c.limits is not None:
                robot.leave('limits (see --stops)', c.name)
    return _head(robot, version) + serialise(entry(whole))


def _body(part: Part, points: _Points) -> dict[str, Any]:
    carried = points.of[part.name]
    fields: dict[str, Any] = {'points': carried, 'mass': part.mass}
    if part.mass == 0.0:
        return fields
    first, *others = (points.at[name] for name in carried)
    axes = frame_axes([place - first for place in others])
    J = axes @ part.inertia @ axes.T
    size = float(np.abs(J).max())
    moments = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    fields['inertia'] = {'about_com': _numbers(np.array(moments), size)}
    fields['com'] = _numbers(axes @ (part.com - first), points.size)
    return fields


def _numbers(values: Floats, size: float) -> list[float]:
    """Values, what is rounding only as zero."""
    return [0.0 if abs(x) < 1e-15 * size else float(x) for x in values]


def _effects(robot: Robot, joints: dict[str, str], stops: float | None) -> dict[str, Any]:
    effects: dict[str, dict[str, Any]] = {}
    if any(robot.gravity):
        effects['gravity'] = {'acceleration': list(robot.gravity)}
    for c in robot.connections:
        joint = {'joint': joints[c.name]}
        if c.damping:
            effects.setdefault('joint_friction', {})[c.name] = {**joint, 'viscous': c.damping}
        if c.stiffness:
            spring = {'stiffness': c.stiffness, 'free_position': c.rest - c.drawn}
            effects.setdefault('torsion_spring', {})[c.name] = joint | spring
        if c.limits is not None and stops is not None:
            lower, upper = (limit - c.drawn for limit in c.limits)
            stop = {'lower': lower, 'upper': upper, 'stiffness': stops}
            effects.setdefault('joint_stop', {})[c.name] = joint | stop
    return effects


def _leave_effects(robot: Robot) -> None:
    """A mechanism has no effects: say which there would have been."""
    if any(robot.gravity):
        robot.leave('gravity (see --scene)', ' '.join(f'{g:g}' for g in robot.gravity))
    for c in robot.connections:
        if c.damping:
            robot.leave('damping (see --scene)', c.name)
        if c.stiffness:
            robot.leave('springs (see --scene)', c.name)


def _head(robot: Robot, version: str) -> str:
    """Where it came from, and what did not come along."""
    lines = [f'Imported from {robot.file} by alf_ros {version}.']
    if robot.left_out:
        lines.append('Not carried over:')
    lines += [f'  {kind}: {", ".join(names)}' for kind, names in robot.left_out.items()]
    clean = (re.sub(r'[^\x20-\x7e\xa0-\ud7ff]', '?', line) for line in lines)
    return ''.join(f'# {line}\n' for line in clean)

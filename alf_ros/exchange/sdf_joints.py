"""The joints of an SDF: axes, limits, forces on their coordinates, mimics, threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange import sdf_gearboxes
from alf_ros.exchange.robot import (
    AXES,
    TYPES,
    AxisForces,
    Connection,
    Coupled,
    Robot,
    RobotPart,
    free_name,
)
from alf_ros.exchange.sdf_frames import MODEL, SdfFrames
from alf_ros.exchange.sdf_values import name_of, number, numbers, says
from alf_ros.exchange.sdf_versions import AXES as _TAGS
from alf_ros.exchange.sdf_versions import OF_MODEL
from alf_ros.scene.text.decimal_numbers import decimal

SCREW = 'screw'  # which only SDF has, with its pitch
_KINDS = TYPES | {SCREW: SCREW}
_ENDLESS = 1e15  # a limit from there on is none: the default is 1e16
_ENDS = (('lower', -1e16), ('upper', 1e16))
_PITCH = 1.0  # m per turn, if a screw has none
_PITCHES = ('screw_thread_pitch', 'thread_pitch')
_PERPENDICULAR = 1e-6  # cosine between two axes
# numbers that soften limits, below an axis and a joint, with the values at which they do not
_SOFT_LIMIT = (('limit/stiffness', 1e8), ('limit/dissipation', 1.0))
_SOFT_LIMIT_ODE = (('limit/cfm', 0.0), ('limit/erp', 0.2), ('bounce', 0.0))
_SOFT_ODE = (('cfm', 0.0), ('suspension/cfm', 0.0))
_LEADERS = ('revolute', 'prismatic', 'universal')  # whose coordinates others mimic
_SCHEMES = ('implicit_spring_damper', 'cfm_damping')  # how steps compute the same forces


def kind_of(element: ElementTree.Element) -> str:
    """The type of a joint, as SDF names it."""
    return element.get('type', '').strip().lower()


def is_gearbox(element: ElementTree.Element) -> bool:
    """Whether it couples two other joints."""
    return kind_of(element) == 'gearbox'


def is_known(element: ElementTree.Element) -> bool:
    """Whether its type is one of `Connection`."""
    return kind_of(element) in _KINDS


def pitch_of(robot: Robot, element: ElementTree.Element, name: str) -> float:
    """Of a screw, m per turn; `thread_pitch`, the older one, is -rad/m. Raises InputError."""
    given = {tag for tag in _PITCHES if (element.findtext(tag) or '').strip()}
    if not given:
        robot.leave('pitch of screws: default of SDF', name)
        return _PITCH
    tag = next(each for each in _PITCHES if each in given)
    value = number(element, tag, _PITCH, robot.error, name)
    if value == 0.0:
        raise robot.error(name, 'a thread without pitch', element)
    return value if tag == 'screw_thread_pitch' else -2.0 * np.pi / value


@dataclass(frozen=True)
class _Axis:
    """An axis of a joint, by the scoped name of the joint and the tag of the axis."""

    joint: str
    tag: str


@dataclass(frozen=True)
class _Mimic:
    """x = multiplier (other - reference) + offset, rad or m."""

    other: _Axis
    multiplier: float
    reference: float
    offset: float


class SdfJoints:
    """Makes connections from the joints of an SDF.

    A coupling cannot have one of the two angles of a universal joint. If a mimic has one, the
    joint becomes a row of two revolutes of the same coordinates, through a part without mass.

    joints: all of the file, each after its scope. held: the scoped names of joints between fixed
    parts. short: names as the robot has them.
    """

    def __init__(
        self,
        robot: Robot,
        frames: SdfFrames,
        joints: Sequence[tuple[str, ElementTree.Element]],
        held: Set[str],
        short: Callable[[str], str],
    ) -> None:
        self._robot, self._frames, self._short = robot, frames, short
        self._held = held
        self._kinds = {
            scope + name_of(each, robot.error): _KINDS.get(kind_of(each), '')
            for scope, each in joints
        }
        self._mimics: dict[_Axis, _Mimic] = {}
        for scope, each in joints:
            self._read_mimics(scope, each)
        self._coordinates = self._of_rows()

    def connections(
        self, scope: str, element: ElementTree.Element, parent: str, child: str
    ) -> Iterator[Connection]:
        """A joint of a known type between two parts, or the row in place of it, of which the part
        between is added to the robot, as the couplings are. Raises InputError."""
        own = scope + name_of(element, self._robot.error)
        whole = self._connection(own, scope, element, parent, child)
        for tag in _TAGS:
            self._couple(_Axis(own, tag))
        names = [self._coordinates.get(_Axis(own, tag)) for tag in _TAGS]
        if None in names or parent == child:
            yield whole
            return
        taken = {part.name for part in self._robot.parts}
        between = free_name(f'{whole.name}_link', taken)
        still = np.zeros((3, 3))
        self._robot.parts.append(RobotPart(between, whole.place, 0.0, whole.place, still))
        forces = whole.of_axes or (AxisForces(), AxisForces())
        sides = ((parent, between), (between, child))
        for name, ends, axis, of in zip(names, sides, whole.axes, forces, strict=True):
            assert name is not None
            yield Connection(name, 'revolute', *ends, whole.place, (axis,), **vars(of))

    def hold(self, scope: str, element: ElementTree.Element) -> None:
        """Note a joint of fixed parts. What it mimics is held by it."""
        own = scope + name_of(element, self._robot.error)
        self._robot.leave('elements', f'joint {element.get("name")} of a fixed part')
        for tag in _TAGS:
            self._couple(_Axis(own, tag))

    def _connection(
        self, own: str, scope: str, element: ElementTree.Element, parent: str, child: str
    ) -> Connection:
        name, place = self._short(own), self._frames.pose(own).origin
        kind = _KINDS[kind_of(element)]
        tags = _TAGS[: AXES.get(kind, 1)]
        axes = tuple(self._axis(scope, element, tag) for tag in tags)
        if len(axes) == 2 and abs(axes[0] @ axes[1]) > _PERPENDICULAR:
            raise self._robot.error(name, 'its two axes are not perpendicular', element)
        if not axes:
            self._leave_of_axes(element, name)  # a ball has none, but files give it some
            return Connection(name, kind, parent, child, place)
        forces = [self._forces(element.find(tag), name) for tag in tags]
        if len(axes) == 2:
            of_axes = tuple(forces) if any(each != AxisForces() for each in forces) else ()
            return Connection(name, kind, parent, child, place, axes, of_axes=of_axes)
        (force,) = forces
        if force.limits and kind == SCREW:  # of an angle, or of a length: simulators differ
            self._robot.leave('limits of screws', name)
            force = replace(force, limits=None)
        pitch = pitch_of(self._robot, element, name) if kind == SCREW else 0.0
        return Connection(name, kind, parent, child, place, axes, pitch=pitch, **vars(force))

    def _forces(self, axis: ElementTree.Element | None, name: str) -> AxisForces:
        """On the coordinate of an axis."""
        lower, upper = self._limits(None if axis is None else axis.find('limit'), name)
        dynamics = None if axis is None else axis.find('dynamics')
        damping, friction, stiffness, rest = (
            self._number(dynamics, tag, 0.0, name)
            for tag in ('damping', 'friction', 'spring_stiffness', 'spring_reference')
        )
        limits = (lower, upper) if min(abs(lower), abs(upper)) < math.inf else None
        return AxisForces(limits, damping, stiffness, rest, friction)

    def gearbox(
        self, scope: str, element: ElementTree.Element, reference: str, parts: Sequence[str]
    ) -> None:
        """Couple what a gearbox couples: parent and child on a reference part."""
        name = self._short(scope + name_of(element, self._robot.error))
        axes = [self._axis(scope, element, tag) for tag in _TAGS]
        ratio = self._number(element, 'gearbox_ratio', 1.0, name)
        sdf_gearboxes.couple(self._robot, name, reference, parts, axes, ratio)

    def leave(self, scope: str, element: ElementTree.Element) -> None:
        """Note what connections do not have of a joint of any type. Raises InputError."""
        name, leave = self._short(scope + element.get('name', '')), self._robot.leave
        limited = False
        for axis in (each for tag in _TAGS if (each := element.find(tag)) is not None):
            limit = axis.find('limit')
            ends = self._limits(limit, name)
            limited |= min(map(abs, ends)) < math.inf
            if self._number(axis, 'initial_position', 0.0, name) != 0.0:
                leave('positions of joints', name)
            for tag, kind in (('effort', 'limits of effort'), ('velocity', 'limits of velocity')):
                if 0.0 <= self._end(limit, tag, math.inf, name) < math.inf:
                    leave(kind, name)
            if min(map(abs, ends)) < math.inf and self._differs(axis, _SOFT_LIMIT, name):
                leave('soft limits', name)
        ode = element.find('physics/ode')
        if limited and self._differs(ode, _SOFT_LIMIT_ODE, name):
            leave('soft limits', name)
        if self._differs(ode, _SOFT_ODE, name):
            leave('softness', name)
        if self._number(ode, 'max_force', 0.0, name) != 0.0:
            leave('actuators', f'{name} (max_force of ODE)')
        for tag in _SCHEMES:
            if says(ode, tag, self._robot.error, name):
                leave('elements', f'{tag} of {name}')

    def _differs(
        self,
        element: ElementTree.Element | None,
        given: Sequence[tuple[str, float]],
        name: str,
    ) -> bool:
        """Whether a number is stated that is another than its default."""
        return any(self._end(element, tag, usual, name) != usual for tag, usual in given)

    def _number(
        self, element: ElementTree.Element | None, tag: str, default: float, key: str
    ) -> float:
        return number(element, tag, default, self._robot.error, key)

    def _leave_of_axes(self, element: ElementTree.Element, name: str) -> None:
        """Note what only joints with axes have here."""
        for axis in (element.find(tag) for tag in _TAGS):
            if axis is None:
                continue
            ends = self._limits(axis.find('limit'), name)
            if axis.find('dynamics') is not None or min(map(abs, ends)) < math.inf:
                self._robot.leave('limits, damping, friction, springs, armature', name)
            if axis.find('mimic') is not None:
                self._robot.leave('mimic', name)

    def _limits(self, limit: ElementTree.Element | None, name: str) -> tuple[float, float]:
        """Lower and upper limit, infinite where there is none."""
        lower, upper = (self._end(limit, tag, default, name) for tag, default in _ENDS)
        return lower, upper

    def _end(
        self, limit: ElementTree.Element | None, tag: str, default: float, name: str
    ) -> float:
        """A number that may be infinite; from 1e15 on it is."""
        inner = None if limit is None else limit.find(tag)
        text = '' if inner is None else (inner.text or '').strip()
        try:
            x = decimal(text) if text else default
        except ValueError:
            x = math.nan
        if math.isnan(x):
            raise self._robot.error(name, 'not a number', inner, value=text)
        return x if abs(x) < _ENDLESS else math.copysign(math.inf, x)

    def _read_mimics(self, scope: str, element: ElementTree.Element) -> None:
        """The mimics of the axes of a joint; list what mimics a joint without such a coordinate.
        Raises InputError."""
        error, leave = self._robot.error, self._robot.leave
        own = scope + name_of(element, error)
        if not self._kinds[own]:
            return
        name = self._short(own)
        for tag in _TAGS[: AXES.get(self._kinds[own], 1)]:
            mimic = element.find(f'{tag}/mimic')
            if mimic is None:
                continue
            other = _Axis(
                self._frames.find(mimic.get('joint', ''), scope, mimic), mimic.get('axis', 'axis')
            )
            driver: _Axis | None = other
            while driver is not None:
                if driver == _Axis(own, tag):
                    raise error(name, 'it mimics itself', mimic)
                driver = self._mimics[driver].other if driver in self._mimics else None
            kind = self._kinds.get(other.joint, '')
            if kind not in _LEADERS or other.tag not in _TAGS[: AXES[kind]]:
                leave('mimic', name)
                continue
            numbers_of = (('multiplier', 1.0), ('reference', 0.0), ('offset', 0.0))
            given = (self._number(mimic, key, default, name) for key, default in numbers_of)
            self._mimics[_Axis(own, tag)] = _Mimic(other, *given)

    def _of_rows(self) -> dict[_Axis, str]:
        """The names of the coordinates of universal joints that couplings have."""
        followed = {mimic.other for mimic in self._mimics.values() if mimic.multiplier}
        coupled = {axis.joint for axis in (*self._mimics, *followed)} - self._held
        taken = {self._short(joint) for joint in self._kinds}
        found = {}
        for joint in self._kinds:
            if joint not in coupled or self._kinds[joint] != 'universal':
                continue
            for tag, end in zip(_TAGS, ('first', 'second'), strict=True):
                own = self._short(joint)
                usual = f'{own}_{end}'
                name = free_name(usual, taken)
                if name != usual:
                    self._robot.leave('names, changed', f'{usual} of {own} is {name}')
                taken.add(name)
                found[_Axis(joint, tag)] = name
        return found

    def _couple(self, axis: _Axis) -> None:
        """Add the coupling of an axis that mimics another one. A joint of fixed parts keeps its
        coordinate."""
        if axis not in self._mimics:
            return
        mimic = self._mimics[axis]
        name, other = (
            self._coordinates.get(each, self._short(each.joint)) for each in (axis, mimic.other)
        )
        of = {} if axis.joint in self._held else {name: 1.0}
        if mimic.multiplier != 0.0 and mimic.other.joint not in self._held:
            of[other] = -mimic.multiplier
        if not of:
            return
        if mimic.offset != mimic.multiplier * mimic.reference:
            self._robot.leave('phase of mimic', name)
        self._robot.couplings.append(Coupled(f'{name}_mimic', of))

    def _axis(self, scope: str, element: ElementTree.Element, tag: str) -> Floats:
        """A unit direction in the world; along z, where <xyz> is absent."""
        name = name_of(element, self._robot.error)
        axis = element.find(tag)
        axis = ElementTree.Element(tag) if axis is None else axis
        xyz = axis.find('xyz')
        error = self._robot.error
        u = numbers('0 0 1' if xyz is None else xyz.text or '', 3, error, name, xyz)
        if not np.linalg.norm(u) > 0.0:
            raise error(name, 'zero is no direction', xyz)
        given = '' if xyz is None else xyz.get('expressed_in', '')
        if given:
            frame = self._frames.find(given, scope, xyz)
        else:
            frame = scope + (MODEL if says(axis, OF_MODEL, error, name) else name)
        turned = self._frames.pose(frame).turn @ (u / np.linalg.norm(u))
        return np.asarray(turned, dtype=float)

"""The joints of an SDF: axes, limits, forces on their coordinates, mimics, threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Sequence
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange import sdf_gearboxes
from alf_ros.exchange.robot import AXES, TYPES, AxisForces, Connection, Coupled, Robot
from alf_ros.exchange.sdf_frames import MODEL, SdfFrames
from alf_ros.exchange.sdf_values import name_of, number, numbers, says
from alf_ros.exchange.sdf_versions import AXES as _TAGS
from alf_ros.exchange.sdf_versions import OF_MODEL
from alf_ros.scene.text.decimal_numbers import decimal

_KINDS = TYPES | {'screw': 'screw'}  # which only SDF has, with its pitch
_ENDLESS = 1e15  # a limit from there on is none: the default is 1e16
_ENDS = (('lower', -1e16), ('upper', 1e16))
_PITCH = 1.0  # m per turn, if a screw has none
_PITCHES = ('screw_thread_pitch', 'thread_pitch')
_PERPENDICULAR = 1e-6  # cosine between two axes
# numbers that soften limits, below an axis and a joint, with the values at which they do not
_SOFT_LIMIT = (('limit/stiffness', 1e8), ('limit/dissipation', 1.0))
_SOFT_LIMIT_ODE = (('limit/cfm', 0.0), ('limit/erp', 0.2), ('bounce', 0.0))
_SOFT_ODE = (('cfm', 0.0), ('suspension/cfm', 0.0))
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


class SdfJoints:
    """Makes connections from the joints of an SDF.

    joints: all of the file, each after its scope. held: the scoped names of joints between fixed
    parts. short: names as the robot has them.
    """

    def __init__(
        self,
        robot: Robot,
        frames: SdfFrames,
        joints: Sequence[tuple[str, ElementTree.Element]],
        held: Container[str],
        short: Callable[[str], str],
    ) -> None:
        self._robot, self._frames, self._short = robot, frames, short
        self._joints, self._held = joints, held
        self._mimicked: dict[str, str] = {}  # by joint, the one that it mimics

    def connection(
        self, scope: str, element: ElementTree.Element, parent: str, child: str
    ) -> Connection:
        """A joint of a known type between two parts. Raises InputError."""
        own = scope + name_of(element, self._robot.error)
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
            for axis in (axis for tag in tags if (axis := element.find(tag)) is not None):
                if axis.find('mimic') is not None:
                    self._robot.leave('mimic', name)
            of_axes = tuple(forces) if any(each != AxisForces() for each in forces) else ()
            return Connection(name, kind, parent, child, place, axes, of_axes=of_axes)
        (force,) = forces
        if force.limits and kind == 'screw':  # of an angle, or of a length: simulators differ
            self._robot.leave('limits of screws', name)
            force = replace(force, limits=None)
        mimic = element.find('axis/mimic')
        if mimic is not None:
            self._mimic(scope, name, mimic)
        pitch = self._pitch(element, name) if kind == 'screw' else 0.0
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

    def _mimic(self, scope: str, name: str, element: ElementTree.Element) -> None:
        """x = multiplier (other - reference) + offset, of a joint with one axis."""
        error = self._robot.error
        other = self._frames.find(element.get('joint', ''), scope, element)
        driver: str | None = self._short(other)
        while driver is not None:
            if driver == name:
                raise error(name, 'it mimics itself', element)
            driver = self._mimicked.get(driver)
        kinds = [kind_of(each) for at, each in self._joints if at + name_of(each, error) == other]
        single = kinds[:1] in (['revolute'], ['continuous'], ['prismatic'])
        if not single or element.get('axis', 'axis') != 'axis':
            self._robot.leave('mimic', name)
            return
        factor, reference, offset = (
            self._number(element, tag, default, name)
            for tag, default in (('multiplier', 1.0), ('reference', 0.0), ('offset', 0.0))
        )
        if offset != factor * reference:
            self._robot.leave('phase of mimic', name)
        moves = factor != 0.0 and other not in self._held
        of = {name: 1.0} | ({self._short(other): -factor} if moves else {})
        self._mimicked[name] = self._short(other)
        self._robot.couplings.append(Coupled(f'{name}_mimic', of))

    def _pitch(self, element: ElementTree.Element, name: str) -> float:
        """m per turn; `thread_pitch`, the older one, is -rad/m."""
        given = {tag for tag in _PITCHES if (element.findtext(tag) or '').strip()}
        if 'screw_thread_pitch' in given:
            return self._number(element, 'screw_thread_pitch', _PITCH, name)
        if not given:
            self._robot.leave('pitch of screws: default of SDF', name)
            return _PITCH
        per_metre = self._number(element, 'thread_pitch', 1.0, name)
        if per_metre == 0.0:
            raise self._robot.error(name, 'a thread without pitch', element)
        return -2.0 * np.pi / per_metre

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

"""The `effects` of the scene of an imported robot."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.exchange.robot import (
    GROUND,
    Actuator,
    Connection,
    FramePose,
    Robot,
    RobotPart,
    Tendon,
)
from alf_ros.scene.text.repetition import NAME

_LOSSES = 10.0  # s/m: no impact leaves the ground faster than 0.1 m/s
_DRAWN = 1e-6  # m: depth as drawn that is not worth a word
_BEYOND = 1e-6  # rad or m: as drawn behind a limit that is not worth a word
_NOTHING = 1e-12  # part of the largest moment of inertia that is rounding
_DIGITS = 15  # of m, for places on bodies: what is less is rounding


@dataclass(frozen=True)
class Named:
    """Names in the file: of joints, and of bodies with the ground; and the frames of bodies as
    drawn, by part."""

    joints: Mapping[str, str]
    bodies: Mapping[str, str]
    frames: Mapping[str, FramePose]

    def place(self, part: str, at: Any) -> list[float]:
        """A place (3,) of the world as drawn, m, in the frame of a part."""
        inner = at if part == GROUND else self.frames[part].inverse.place(at)
        return [round(float(x), _DIGITS) + 0.0 for x in inner]

    def direction(self, part: str, axis: Any) -> list[float]:
        """A direction (3,) of the world as drawn, in the frame of a part."""
        return [round(float(x), _DIGITS) + 0.0 for x in self.frames[part].turn.T @ axis]


def entries(
    robot: Robot, named: Named, stops: float | None, contact: float | None
) -> dict[str, Any]:
    """Effects, by kind and name. stops, contact: stiffnesses, see `mechanism_text.text`."""
    effects = _of_joints(robot, named.joints, stops)
    if drags := _of_balls(robot, named):
        effects['drag'] = drags
    tendons = _tendons(robot, named, stops)
    effects |= {'tendon': tendons} if tendons else {}
    if contact is not None and robot.touches:
        effects['ground_contact'] = _contacts(robot, named, contact)
    if lifts := _lifts(robot, named):
        effects['constant_wrench'] = lifts
    return effects


def _tendons(robot: Robot, named: Named, stops: float | None) -> dict[str, dict[str, Any]]:
    """An instance for the springs, losses and rotor of each tendon, and one for each actuator on
    it."""
    entries: dict[str, dict[str, Any]] = {}
    shapes: dict[str, tuple[dict[str, Any], float]] = {}
    for each in robot.tendons:
        if not (
            named.joints.keys() >= each.joints.keys()
            and named.bodies.keys() >= {part for part, _ in each.path}
        ):
            robot.leave('tendons', f'{each.name} holds a part without mass')
            continue
        shape: dict[str, Any] = _length(each, named)
        shapes[each.name] = shape, each.drawn
        acting: dict[str, Any] = {}
        if each.stiffness:
            acting |= _spring(each)
        acting |= {'damping': each.damping} if each.damping else {}
        if each.friction:
            robot.leave('law of dry friction', each.name)
            acting['friction'] = each.friction
        if each.limits is not None and stops is not None and not each.limits[0] < each.limits[1]:
            robot.leave('limits without range', each.name)
        elif each.limits is not None and stops is not None:
            ends = _ends(each.limits, each.drawn)
            acting |= ends | {'stop_stiffness': stops} if ends else {}
            _leave_beyond(robot, each.name, each.drawn, each.limits)
        acting |= {'armature': each.armature} if each.armature else {}
        if acting:
            entries[_label(each.name, entries)] = shape | acting
    for actuator in robot.actuators:
        if actuator.on_tendon and actuator.joint in shapes:
            shape, drawn = shapes[actuator.joint]
            taken = {*entries, *named.joints.values()}  # targets of a joint's name are its own
            entries[_label(actuator.name, taken)] = shape | _drive(actuator, drawn)
    return entries


def _length(tendon: Tendon, named: Named) -> dict[str, Any]:
    if tendon.joints:
        return {'joints': [[named.joints[name], c] for name, c in tendon.joints.items()]}
    path = [[named.bodies[part], named.place(part, at)] for part, at in tendon.path]
    plain = all(weight == 1.0 for weight in tendon.weights)
    return {'path': path} | ({} if plain else {'weights': list(tendon.weights)})


def _spring(tendon: Tendon) -> dict[str, Any]:
    """Of stiffness outside an interval without force."""
    k, (first, last) = tendon.stiffness, tendon.rest
    spring: dict[str, Any] = {'free_length': first - tendon.drawn}
    if first == last:
        return spring | {'stiffness': k}
    play = last - first
    return spring | {'table': [[-1.0, -k], [0.0, 0.0], [play, 0.0], [play + 1.0, k]]}


def _drive(actuator: Actuator, drawn: float) -> dict[str, Any]:
    """The keys of a motor, for a coordinate that the source has at `drawn` as drawn."""
    drive: dict[str, Any] = {'effort': actuator.effort} if actuator.effort else {}
    if actuator.position is not None:
        drive['position'] = actuator.position - drawn
        drive['position_gain'] = actuator.position_gain
    if actuator.velocity is not None:
        drive['velocity'] = actuator.velocity
    if actuator.velocity_gain:
        drive['velocity_gain'] = actuator.velocity_gain
    if actuator.limit is not None:
        drive['limit'] = actuator.limit
    return drive


def _contacts(robot: Robot, named: Named, stiffness: float) -> dict[str, dict[str, Any]]:
    contacts: dict[str, dict[str, Any]] = {}
    deepest: dict[str, float] = {}
    for each in robot.touches:
        if each.part not in named.frames:
            continue
        contact: dict[str, Any] = {
            'on': named.bodies[each.part],
            'at': named.place(each.part, each.centre),
            'stiffness': stiffness,
            'damping': _LOSSES,
        }
        contact |= {'radius': each.radius} if each.radius else {}
        if each.axle is not None:
            contact['axle'] = named.direction(each.part, each.axle)
        contact |= {'friction': each.friction} if each.friction else {}
        contact |= {'through': each.plane.through.tolist()} if any(each.plane.through) else {}
        if each.plane.normal[2] != 1.0:
            contact['normal'] = each.plane.normal.tolist()
        if each.turning:
            robot.leave('friction of contact', each.part)
        contacts[_label(each.name, contacts)] = contact
        deepest[each.part] = max(deepest.get(each.part, 0.0), each.depth)
    for part, depth in deepest.items():
        if depth > _DRAWN:
            robot.leave('contact as drawn', f'{part} by {depth:.3g} m')
    robot.leave('law of contact', '')
    return contacts


def _of_joints(robot: Robot, joints: Mapping[str, str], stops: float | None) -> dict[str, Any]:
    """Coordinates are zero as drawn."""
    effects: dict[str, dict[str, Any]] = {}
    if any(robot.gravity):
        effects['gravity'] = {'acceleration': list(robot.gravity)}
    for whole in robot.connections:
        for suffix, c in whole.coordinates():
            _check(robot, c, whole.name)
            _act(robot, c, joints[whole.name] + suffix, stops, effects)
    motors = _motors(robot, joints)
    return effects | ({'motor': motors} if motors else {})


def _act(
    robot: Robot,
    c: Connection,
    name: str,
    stops: float | None,
    effects: dict[str, dict[str, Any]],
) -> None:
    """Add the forces on a coordinate, which has the name in the file."""
    joint = {'joint': name}
    if (c.damping or c.friction) and c.kind != 'spherical':
        rubs = {'viscous': c.damping} if c.damping else {}
        if c.friction:
            robot.leave('law of dry friction', c.name)
            rubs |= {'dynamic': 1.0, 'load': c.friction}
        effects.setdefault('joint_friction', {})[name] = joint | rubs
    if c.stiffness:
        spring = {'stiffness': c.stiffness, 'free_position': c.rest - c.drawn}
        effects.setdefault('torsion_spring', {})[name] = joint | spring
    if c.limits is not None and stops is not None and not c.limits[0] < c.limits[1]:
        robot.leave('limits without range', c.name)
    elif c.limits is not None and stops is not None:
        if ends := _ends(c.limits, c.drawn):
            effects.setdefault('joint_stop', {})[name] = joint | ends | {'stiffness': stops}
        _leave_beyond(robot, c.name, c.drawn, c.limits)


def _of_balls(robot: Robot, named: Named) -> dict[str, dict[str, Any]]:
    """The damping -d ω of balls against the ground, as drag of the rotation of their parts. Those
    between two parts, or of a part that turns without inertia, are listed."""
    turning = {part.name for part in robot.parts if _turns(part)}
    drags = {}
    for c in robot.connections:
        if c.kind != 'spherical' or not c.damping:
            continue
        if c.parent == GROUND and c.child in turning:
            drags[named.joints[c.name]] = {'on': named.bodies[c.child], 'spin': c.damping}
        else:
            robot.leave('damping of balls', c.name)
    return drags


def _lifts(robot: Robot, named: Named) -> dict[str, dict[str, Any]]:
    """Forces that compensate gravity; list those beside the centre of mass of a part that does not
    turn, on which there is no place but its points."""
    lifts = {}
    for part in robot.parts:
        if part.name not in robot.lifts:
            continue
        lift = robot.lifts[part.name]
        body = named.bodies[part.name]
        fields: dict[str, Any] = {'on': body, 'force': lift.force.tolist()}
        if not np.array_equal(lift.place, part.com):
            if not _turns(part):
                robot.leave('compensation of gravity', part.name)
                continue
            fields['at'] = named.place(part.name, lift.place)
        lifts[f'{body}_lift'] = fields
    return lifts


def _turns(part: RobotPart) -> bool:
    """Whether a part has inertia about every axis, so that its rotation is determined."""
    moments = np.linalg.eigvalsh(part.inertia)
    return bool(moments[0] > _NOTHING * moments[-1])


def _check(robot: Robot, c: Connection, joint: str) -> None:
    """Refuse losses and springs of a joint that give energy. Raises InputError."""
    for key, x in (('damping', c.damping), ('friction', c.friction), ('stiffness', c.stiffness)):
        if x < 0.0:
            raise robot.error(c.name, f'negative {key}', robot.places.get(joint), value=x)


def _ends(limits: tuple[float, float], drawn: float) -> dict[str, float]:
    """The limits that are finite, of a coordinate that is zero as drawn."""
    ends = zip(('lower', 'upper'), limits, strict=True)
    return {key: limit - drawn for key, limit in ends if math.isfinite(limit)}


def _leave_beyond(robot: Robot, name: str, drawn: float, limits: tuple[float, float]) -> None:
    """Note a joint or a tendon that is drawn beyond a limit, from which a stop throws it back."""
    depth, limit = max((limits[0] - drawn, limits[0]), (drawn - limits[1], limits[1]))
    if depth > _BEYOND:
        robot.leave('limits as drawn', f'{name} is at {drawn:.6g}, its limit is {limit:.6g}')


def _motors(robot: Robot, joints: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """A motor for each actuator, and for each rotor; the first of a joint has its rotor."""
    drawn = {c.name: c.drawn for c in robot.connections}
    rotors = {c.name: c.armature for c in robot.connections if c.armature}
    motors: dict[str, dict[str, Any]] = {}
    for each in robot.actuators:
        if each.on_tendon:
            continue
        if each.limit is not None and not (each.position_gain or each.velocity_gain):
            robot.leave('limits of motors', each.name)  # which are commanded by efforts
        motor = {'joint': joints[each.joint]} | _drive(each, drawn[each.joint])
        if each.joint in rotors:
            motor['armature'] = rotors.pop(each.joint)
        motors[_label(each.name, motors)] = motor
    for joint, armature in rotors.items():
        motors[_label(joints[joint], motors)] = {'joint': joints[joint], 'armature': armature}
    return motors


def _label(name: str, taken: Container[str]) -> str:
    """A name for an effect that no other effect of its kind has."""
    stem = re.sub(r'[^A-Za-z0-9_]', '_', name)[:80]
    stem = stem if NAME.fullmatch(stem) else f'n_{stem}'
    label, n = stem, 2
    while label in taken:
        label, n = f'{stem}_{n}', n + 1
    return label


def leave(robot: Robot) -> None:
    """A mechanism has no effects: say which there would have been."""
    if any(robot.gravity):
        robot.leave('gravity (see --scene)', ' '.join(f'{g:g}' for g in robot.gravity))
    for c in (each for whole in robot.connections for _, each in whole.coordinates()):
        for kind, value in (
            ('damping', c.damping),
            ('dry friction', c.friction),
            ('springs', c.stiffness),
            ('armature', c.armature),
        ):
            if value:
                robot.leave(f'{kind} (see --scene)', c.name)
    for tendon in robot.tendons:
        if tendon.stiffness or tendon.damping or tendon.friction or tendon.armature:
            robot.leave('tendons (see --scene)', tendon.name)
    for actuator in robot.actuators:
        robot.leave('actuators (see --scene)', actuator.name)
    for name in robot.velocities:
        robot.leave('velocities of bodies (see --scene)', name)
    for name in robot.lifts:
        robot.leave('compensation of gravity (see --scene)', name)

"""Limits, drives, springs, losses and rotors of the joints in a USD stage, in rad, m, kg and s.

An angle is in degrees in the file, and stiffness and damping are per degree; gains `mjc:*` are per
rad, and angles `mjc:*` have the unit that the scene states. A drive applies stiffness (target -
x) + damping (target velocity - ẋ), at most `maxForce`. Of the same quantity in several namespaces
`mjc:*` counts before `newton:*`, and this before PhysX, because it has all digits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from alf_ros.exchange.robot import Actuator, Connection, Robot
from alf_ros.exchange.usd_joints import SLIDES, TURNS, UsdJoint, bounds
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage

_ROUNDED = 1e-5  # of a quantity: the same number in several attributes, with seven digits
_TYPED = {
    'revolute': 'angular',
    'prismatic': 'linear',
}  # drives of the joints that are typed so; general ones have those of their freedoms


def limits(stage: UsdStage, scene: UsdScene, joint: UsdJoint) -> tuple[float, float] | None:
    """Of a joint with one coordinate, rad or m; None without limits. Raises InputError."""
    prefix, names = 'physics:', ('lowerLimit', 'upperLimit')
    if _is_general(joint):
        if f'PhysicsLimitAPI:{joint.degree}' not in stage.schemas(joint.prim):
            return None
        prefix, names = f'limit:{joint.degree}:physics:', ('low', 'high')
    low, high = (_unit(stage, joint) * x for x in bounds(stage, joint.prim, prefix, names))
    if low == -math.inf and high == math.inf or not scene.kept('limits', 1.0):
        return None
    return low, high


def in_range(x: float, ends: tuple[float, float] | None) -> float:
    """An angle, rad, or the one turn more or less that is within its limits.

    Limits that leave a whole turn, as one limit does, have a turn of every angle within: there
    the angle counts unless it is more than half a turn beyond a limit.
    """
    low, high = ends or (-math.inf, math.inf)
    if high - low >= 2.0 * math.pi and low - math.pi <= x <= high + math.pi:
        return x
    around = (x, x + 2.0 * math.pi, x - 2.0 * math.pi)
    return next((each for each in around if low <= each <= high), x)


def reference(stage: UsdStage, scene: UsdScene, joint: UsdJoint) -> float:
    """The coordinate, rad or m, of a joint of which both frames coincide. Raises InputError."""
    return stage.number(joint.prim, 'mjc:ref') * _mjc_unit(stage, scene, joint)


def with_passive(
    stage: UsdStage, scene: UsdScene, robot: Robot, joint: UsdJoint, made: Connection
) -> Connection:
    """A connection with spring, losses and rotor of a joint. Raises InputError."""
    turns = joint.kind == 'revolute'
    degree = _unit(stage, joint) if turns else 1.0
    force = stage.kilogram * stage.metre * (stage.metre if turns else 1.0)
    per_unit = force / (1.0 if turns else stage.metre)

    def value(what: str, units: Mapping[str, float]) -> float:
        return scene.kept(what, _first(stage, robot, joint, units))

    rotors = {f'{each}:armature': per_unit for each in ('mjc', 'newton', 'physxJoint')}
    rest = stage.number(joint.prim, 'mjc:springref') * _mjc_unit(stage, scene, joint)
    made = replace(
        made,
        rest=rest,
        armature=_first(stage, robot, joint, rotors),
        damping=value('damping', {'mjc:damping': per_unit, 'newton:damping': per_unit / degree}),
        friction=value('dry friction', {'mjc:frictionloss': force, 'newton:friction': force}),
        stiffness=value('springs', {'mjc:stiffness': per_unit}),
    )
    times = stage.numbers(joint.prim, 'mjc:springdamper', (0.0, 0.0))
    if times.all():
        robot.leave('springs by time constants', joint.name)
    return made


def _first(stage: UsdStage, robot: Robot, joint: UsdJoint, units: Mapping[str, float]) -> float:
    """The first authored attribute of some for one quantity, each with its unit."""
    found = []
    for name, unit in units.items():
        if not stage.is_authored(joint.prim, name):
            continue
        number = stage.number(joint.prim, name)
        if number < 0.0:
            key = f'{joint.prim.GetPath()} {name}'
            raise stage.error(key, 'it is negative', value=number, expected='zero or more')
        found.append(unit * number)
    if found and max(found) - min(found) > _ROUNDED * max(found):
        names = ', '.join(each for each in units if stage.is_authored(joint.prim, each))
        robot.leave('attributes that disagree', f'{joint.name} ({names})')
    return found[0] if found else 0.0


def add_actuators(stage: UsdStage, robot: Robot, joint: UsdJoint) -> None:
    """Add the drives of a joint to its robot; list those that apply no force here. Raises
    InputError."""
    schemas = stage.schemas(joint.prim)
    for schema in schemas:
        drive = schema.removeprefix('PhysicsDriveAPI:')
        if drive == schema:
            continue
        if drive in (*SLIDES, *TURNS) and drive not in joint.free and _is_general(joint):
            continue  # it is locked, or another part of a chain has it
        if not joint.degree or drive != drive_name(joint):
            robot.leave('actuators', f'{joint.name} ({drive})')
        elif _kind(stage, joint, drive) == 'acceleration':
            robot.leave('actuators', f'{joint.name} (it sets accelerations)')
        else:
            robot.actuators.append(_drive(stage, robot, joint, drive))


def drive_name(joint: UsdJoint) -> str:
    """The drive that acts on a joint with one coordinate, by the specification and in PhysX: one
    of another name, such as `rotY` of a revolute joint about y, exerts no force."""
    return joint.degree if _is_general(joint) else _TYPED[joint.kind]


def _is_general(joint: UsdJoint) -> bool:
    return str(joint.prim.GetTypeName()) == 'PhysicsJoint'


def _kind(stage: UsdStage, joint: UsdJoint, drive: str) -> str:
    name = f'drive:{drive}:physics:type'
    return stage.choice(joint.prim, name, 'force', ('force', 'acceleration'))


def _drive(stage: UsdStage, robot: Robot, joint: UsdJoint, drive: str) -> Actuator:
    unit, turns = _unit(stage, joint), joint.kind == 'revolute'
    force = stage.kilogram * stage.metre * (stage.metre if turns else 1.0)
    names = ('stiffness', 'damping', 'targetPosition', 'targetVelocity')
    stiffness, damping, place, speed = (_value(stage, joint, drive, name) for name in names)
    most = stage.number(joint.prim, f'drive:{drive}:physics:maxForce', np.inf, endless=True)
    if stiffness < 0.0 or damping < 0.0 or most < 0.0:
        key = f'{joint.prim.GetPath()} drive:{drive}'
        raise stage.error(key, 'stiffness, damping and maxForce are not negative')
    if not stiffness and not damping:
        robot.leave('gains of actuators', joint.name)
    return Actuator(
        joint.name,
        joint.name,
        position=unit * place if stiffness else None,
        position_gain=stiffness * force / unit,
        velocity=unit * speed if damping and speed else None,
        velocity_gain=damping * force / unit,
        limit=most * force if most < np.inf else None,
    )


def _value(stage: UsdStage, joint: UsdJoint, drive: str, name: str) -> float:
    return stage.number(joint.prim, f'drive:{drive}:physics:{name}')


def _unit(stage: UsdStage, joint: UsdJoint) -> float:
    """Of the coordinate of a joint in the file, rad or m."""
    return math.pi / 180.0 if joint.kind == 'revolute' else stage.metre


def _mjc_unit(stage: UsdStage, scene: UsdScene, joint: UsdJoint) -> float:
    """Of the coordinate of a joint in attributes `mjc:*`, rad or m."""
    return scene.angle if joint.kind == 'revolute' else stage.metre

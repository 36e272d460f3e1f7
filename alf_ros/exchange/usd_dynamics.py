"""Limits, drives and rotors of the joints in a USD stage, in rad, m, kg and s.

An angle is in degrees in the file, and stiffness and damping of a drive are per degree. A drive
applies stiffness (target - x) + damping (target velocity - ẋ), at most `maxForce`.
"""

from __future__ import annotations

import math

import numpy as np

from alf_ros.exchange.robot import Actuator, Robot
from alf_ros.exchange.usd_joints import UsdJoint, bounds
from alf_ros.exchange.usd_stage import UsdStage

_SHORT = {
    'revolute': 'angular',
    'prismatic': 'linear',
}  # names of drives where a joint has one axis


def limits(stage: UsdStage, joint: UsdJoint) -> tuple[float, float] | None:
    """Of a joint with one coordinate, rad or m; None without limits. Raises InputError."""
    prefix, names = 'physics:', ('lowerLimit', 'upperLimit')
    if str(joint.prim.GetTypeName()) == 'PhysicsJoint':
        if f'PhysicsLimitAPI:{joint.degree}' not in stage.schemas(joint.prim):
            return None
        prefix, names = f'limit:{joint.degree}:physics:', ('low', 'high')
    low, high = (_unit(stage, joint) * x for x in bounds(stage, joint.prim, prefix, names))
    return None if low == -math.inf and high == math.inf else (low, high)


def in_range(x: float, ends: tuple[float, float] | None) -> float:
    """An angle, rad, or the one turn more or less that is within its limits."""
    low, high = ends or (-math.inf, math.inf)
    around = (x, x + 2.0 * math.pi, x - 2.0 * math.pi)
    return next((each for each in around if low <= each <= high), x)


def armature(stage: UsdStage, joint: UsdJoint) -> float:
    """Inertia of a rotor, kg m^2 or kg: an attribute of PhysX. Raises InputError."""
    found = max(0.0, stage.number(joint.prim, 'physxJoint:armature'))
    return found * stage.kilogram * (stage.metre**2 if joint.kind == 'revolute' else 1.0)


def add_actuators(stage: UsdStage, robot: Robot, joint: UsdJoint) -> None:
    """Add the drives of a joint to its robot; list those that apply no force here. Raises
    InputError."""
    schemas = stage.schemas(joint.prim)
    for schema in schemas:
        drive = schema.removeprefix('PhysicsDriveAPI:')
        if drive == schema:
            continue
        if not joint.degree or drive not in (joint.degree, _SHORT[joint.kind]):
            robot.leave('actuators', f'{joint.name} ({drive})')
        elif stage.word(joint.prim, f'drive:{drive}:physics:type') == 'acceleration':
            robot.leave('actuators', f'{joint.name} (it sets accelerations)')
        else:
            robot.actuators.append(_drive(stage, robot, joint, drive))


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

"""Actuators of MuJoCo and Newton in a USD stage: prims that name the joint or tendon they drive.

`MjcActuator` has the law of `general_actuator`, as in an MJCF; its control is zero, within its
range. `NewtonActuator` has a constant effort and PD gains per rad or m; it holds the target of the
drive of its joint, or zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from alf_ros.exchange import mjcf_force_ranges
from alf_ros.exchange.general_actuator import GeneralActuator
from alf_ros.exchange.mjcf_force_ranges import Driving
from alf_ros.exchange.robot import Actuator, Robot
from alf_ros.exchange.usd_dynamics import drive_name
from alf_ros.exchange.usd_joints import UsdJoint
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage

_DYNAMICS = {
    'none': '',
    'integrator': 'integrators of actuators',
    'filter': 'activation of actuators',
    'filterexact': 'activation of actuators',
    'muscle': 'activation of actuators',
}


def add(
    stage: UsdStage,
    scene: UsdScene,
    robot: Robot,
    joints: Sequence[UsdJoint],
    tendons: Mapping[str, str],
) -> None:
    """Add the actuators of joints and tendons to a robot; list the others. Raises InputError.

    tendons: names, by path.
    """
    moving = {each.name for each in robot.connections}
    single = {str(j.prim.GetPath()): j for j in joints if j.degree and j.name in moving}
    driving: dict[str, list[Driving]] = {}
    for prim in stage.prims():
        kind = str(prim.GetTypeName())
        if kind == 'NewtonActuator':
            joint = single.get(next(iter(stage.targets(prim, 'newton:targets')), ''))
            _add_pd(stage, robot, prim, joint)
        elif kind == 'MjcActuator':
            (on, *_), name = (*stage.targets(prim, 'mjc:target'), ''), prim.GetName()
            if scene.is_group_off(int(stage.number(prim, 'mjc:group'))):
                robot.leave('switched off in the file', name)
            elif on not in single and on not in tendons:
                robot.leave('actuators', name)
            else:
                is_tendon = on in tendons
                to = tendons[on] if is_tendon else single[on].name
                actuator = _general(stage, scene, robot, prim, to, is_tendon)
                drive = None if actuator is None else actuator.drive
                if actuator is None or drive is None:
                    robot.leave('actuators', name)
                    continue
                if not is_tendon:
                    drive = _in_si(stage, single[on], drive)
                if actuator.is_lopsided:
                    robot.leave('force ranges of actuators', name)
                driving.setdefault(on, []).append(Driving(drive, 0, 0, actuator.gear))
    for on, group in driving.items():
        robot.actuators += _within(stage, robot, stage.prim(on), group)


def _general(
    stage: UsdStage, scene: UsdScene, robot: Robot, prim: Any, on: str, is_tendon: bool
) -> GeneralActuator | None:
    """None for one with another law."""
    name = prim.GetName()
    bias_type, dynamics = (
        stage.word(prim, f'mjc:{key}', 'none') for key in ('biasType', 'dynType')
    )
    if (
        stage.word(prim, 'mjc:gainType', 'fixed') != 'fixed'
        or bias_type not in ('none', 'affine')
        or dynamics not in _DYNAMICS
    ):
        return None
    if _DYNAMICS[dynamics]:
        robot.leave(_DYNAMICS[dynamics], name)
    gears, gains, biases = (
        stage.array(prim, f'mjc:{key}', float) for key in ('gear', 'gainPrm', 'biasPrm')
    )
    bias = np.zeros(3)
    if bias_type == 'affine':
        bias[: min(biases.size, 3)] = biases[:3]
    control_range = _range(stage, prim, 'ctrl')
    if control_range and scene.is_off('ranges of controls'):
        robot.leave('switched off in the file', 'ranges of controls')
        control_range = None
    if dynamics == 'integrator':
        control_range = None
    if dynamics != 'none' and (acting := _range(stage, prim, 'act')):
        control_range = acting
    low, high = control_range or (-math.inf, math.inf)
    made = GeneralActuator(
        name,
        on,
        float(gears[0]) if gears.size else 1.0,
        float(gains[0]) if gains.size else 1.0,
        (float(bias[0]), float(bias[1]), float(bias[2])),
        min(max(0.0, low), high),
        control_range,
        _range(stage, prim, 'force'),
        is_tendon,
    )
    if not np.isfinite([made.gear, made.gain, *made.bias]).all():
        raise stage.error(f'{prim.GetPath()} gear, gainPrm, biasPrm', 'not usable numbers')
    return made


def _range(stage: UsdStage, prim: Any, what: str) -> tuple[float, float] | None:
    """Of control, activation or force of an actuator; None where there is none."""
    low, high = (stage.number(prim, f'mjc:{what}Range:{end}') for end in ('min', 'max'))
    limited = stage.word(prim, f'mjc:{what}Limited', 'auto')
    return (low, high) if limited == 'true' or (limited != 'false' and low < high) else None


def _in_si(stage: UsdStage, joint: UsdJoint, drive: Actuator) -> Actuator:
    turns = joint.kind == 'revolute'
    length = 1.0 if turns else stage.metre
    force = stage.kilogram * stage.metre * (stage.metre if turns else 1.0)
    return replace(
        drive,
        effort=drive.effort * force,
        position=None if drive.position is None else drive.position * length,
        position_gain=drive.position_gain * force / length,
        velocity=None if drive.velocity is None else drive.velocity * length,
        velocity_gain=drive.velocity_gain * force / length,
        limit=None if drive.limit is None else drive.limit * force,
    )


def _within(
    stage: UsdStage, robot: Robot, prim: Any, group: Sequence[Driving]
) -> Sequence[Actuator]:
    """The actuators of one joint or tendon, within the range of their sum."""
    low, high = (stage.number(prim, f'mjc:actuatorfrcrange:{end}') for end in ('min', 'max'))
    limited = stage.word(prim, 'mjc:actuatorfrclimited', 'auto')
    if limited == 'false' or not (limited == 'true' or low < high):
        return [each.actuator for each in group]
    if not np.isclose(-low, high):
        for each in group:
            robot.leave('force ranges of actuators', each.actuator.name)
    return mjcf_force_ranges.limited(robot, group, max(-low, high))


def _add_pd(stage: UsdStage, robot: Robot, prim: Any, joint: UsdJoint | None) -> None:
    """An actuator of Newton; one without a PD law is listed."""
    name, schemas = prim.GetName(), stage.schemas(prim)
    integrates = 'NewtonPIDControlAPI' in schemas and stage.number(prim, 'newton:ki')
    known = {'NewtonPDControlAPI', 'NewtonPIDControlAPI'}.intersection(schemas)
    if joint is None or not known or integrates:
        robot.leave('actuators', name)
        return
    if 'NewtonActuatorDelayAPI' in schemas and stage.number(prim, 'newton:delaySteps', 1.0):
        robot.leave('activation of actuators', name)
    effort, k_p, k_v = (stage.number(prim, f'newton:{key}') for key in ('constEffort', 'kp', 'kd'))
    if k_p < 0.0 or k_v < 0.0:
        raise stage.error(str(prim.GetPath()), 'kp and kd are not negative')
    most = stage.number(prim, 'newton:maxEffort', np.inf, endless=True)
    turns = joint.kind == 'revolute'
    prefix = f'drive:{drive_name(joint)}:physics:target'
    unit = math.radians(1.0) if turns else 1.0
    place, speed = (
        unit * stage.number(joint.prim, prefix + key) for key in ('Position', 'Velocity')
    )
    made = Actuator(
        name,
        joint.name,
        effort=effort,
        position=place if k_p else None,
        position_gain=k_p,
        velocity=speed if k_v and speed else None,
        velocity_gain=k_v,
        limit=most if most < np.inf else None,
    )
    robot.actuators.append(_in_si(stage, joint, made))

"""Actuators of an MJCF on hinges and slides, as compiled by MuJoCo.

The force is gain · u + bias, between the ends of its range; u is the control, of the keyframe or
zero, bias = b0 + b1 l + b2 l̇ with l = gear · x, and gear times the force acts on the joint. So
k_p = -gear² b1, k_v = -gear² b2, and x* where the rest vanishes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros.exchange.robot import Actuator, Robot


def add(robot: Robot, mujoco: Any, data: Any, names: Sequence[str], joints: Sequence[str]) -> None:
    """Add the actuators of a model to its robot; list those that push nothing here.

    data: with the controls. names: of the actuators; joints: of the joints.
    """
    model = data.model
    for n, name in enumerate(names):
        joint = _joint(mujoco, model, n)
        fixed = model.actuator_gaintype[n] == mujoco.mjtGain.mjGAIN_FIXED
        bias = model.actuator_biastype[n]
        plain = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
        if joint < 0 or not fixed or bias not in plain:
            robot.leave('actuators', name)
            continue
        made = _actuator(name, joints[joint], model, n, float(data.ctrl[n]))
        if made is None:
            robot.leave('actuators', name)
            continue
        if model.actuator_dyntype[n] != mujoco.mjtDyn.mjDYN_NONE:
            robot.leave('activation of actuators', name)
        for limited, (low, high) in (
            (model.actuator_forcelimited[n], model.actuator_forcerange[n]),
            (model.actuator_ctrllimited[n] and bias == plain[0], model.actuator_ctrlrange[n]),
        ):
            if limited and not np.isclose(-low, high):
                robot.leave('force ranges of actuators', name)
        robot.actuators.append(made)


def _joint(mujoco: Any, model: Any, n: int) -> int:
    """The hinge or slide that an actuator pushes, -1 for anything else."""
    at = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    joint = int(model.actuator_trnid[n, 0])
    single = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    if model.actuator_trntype[n] not in at or model.jnt_type[joint] not in single:
        return -1
    return joint


def _actuator(name: str, joint: str, model: Any, n: int, control: float) -> Actuator | None:
    """None for one that pushes away from where it shall be, or that has no gear."""
    gear = float(model.actuator_gear[n, 0])
    b0, b1, b2 = map(float, model.actuator_biasprm[n, :3])
    gain = float(model.actuator_gainprm[n, 0])
    if model.actuator_ctrllimited[n]:
        control = float(np.clip(control, *model.actuator_ctrlrange[n]))
    force = gain * control + b0
    if b1 > 0.0 or b2 > 0.0 or gear == 0.0:
        return None
    limits = []
    if model.actuator_forcelimited[n]:
        limits.append(abs(gear) * float(np.abs(model.actuator_forcerange[n]).max()))
    if model.actuator_ctrllimited[n] and not b1 and not b2:
        most = float(np.abs(model.actuator_ctrlrange[n]).max())
        limits.append(abs(gear) * (abs(gain) * most + abs(b0)))
    j = int(model.actuator_trnid[n, 0])
    if model.jnt_actfrclimited[j]:
        limits.append(float(np.abs(model.jnt_actfrcrange[j]).max()))
    limit = min(limits) if limits else None
    if b1:
        place, stiff, damp = -force / (b1 * gear), -b1 * gear**2, -b2 * gear**2
        return Actuator(
            name, joint, position=place, position_gain=stiff, velocity_gain=damp, limit=limit
        )
    if b2:
        speed = -force / (b2 * gear)
        return Actuator(name, joint, velocity=speed, velocity_gain=-b2 * gear**2, limit=limit)
    return Actuator(name, joint, effort=gear * force, limit=limit)

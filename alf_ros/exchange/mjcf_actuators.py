"""Actuators of an MJCF on hinges, slides and tendons, as compiled by MuJoCo.

The force is gain · u + bias, between the ends of its range; u is the control, of the keyframe or
zero, bias = b0 + b1 l + b2 l̇ with l = gear · x, and gear times the force acts on x. So
k_p = -gear² b1, k_v = -gear² b2, and x* where the rest vanishes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alf_ros.exchange import mjcf_switches
from alf_ros.exchange.robot import Actuator, Robot


def add(
    robot: Robot,
    mujoco: Any,
    data: Any,
    names: Sequence[str],
    joints: Sequence[str],
    tendons: Mapping[int, str],
) -> None:
    """Add the actuators of a model to its robot; list those that push nothing here.

    data: with the controls. names: of the actuators; joints: of the joints; tendons: by number
    those that are of the robot.
    """
    model = data.model
    for n, name in enumerate(names):
        if mjcf_switches.is_off(mujoco, model, n):
            robot.leave('switched off in the file', name)
            continue
        on = _acts_on(mujoco, model, n, joints, tendons)
        fixed = model.actuator_gaintype[n] == mujoco.mjtGain.mjGAIN_FIXED
        bias = model.actuator_biastype[n]
        plain = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
        made = None
        if on is not None and fixed and bias in plain:
            made = _actuator(name, on, model, n, float(data.ctrl[n]))
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


@dataclass(frozen=True)
class _Coordinate:
    """A joint or a tendon that an actuator pushes: its name, and the largest force there."""

    name: str
    is_tendon: bool
    limit: float | None


def _acts_on(
    mujoco: Any, model: Any, n: int, joints: Sequence[str], tendons: Mapping[int, str]
) -> _Coordinate | None:
    """The hinge, slide or tendon that an actuator pushes, None for anything else."""
    kinds, kind, at = mujoco.mjtTrn, model.actuator_trntype[n], int(model.actuator_trnid[n, 0])
    if kind == kinds.mjTRN_TENDON and at in tendons:
        limited, ends = model.tendon_actfrclimited[at], model.tendon_actfrcrange[at]
        name = tendons[at]
    elif kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        if model.jnt_type[at] not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            return None
        limited, ends, name = model.jnt_actfrclimited[at], model.jnt_actfrcrange[at], joints[at]
    else:
        return None
    limit = float(np.abs(ends).max()) if limited else None
    return _Coordinate(name, bool(kind == kinds.mjTRN_TENDON), limit)


def _actuator(name: str, on: _Coordinate, model: Any, n: int, control: float) -> Actuator | None:
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
    if on.limit is not None:
        limits.append(on.limit)
    made = Actuator(name, on.name, limit=min(limits, default=None), on_tendon=on.is_tendon)
    if b1:
        place, stiff, damp = -force / (b1 * gear), -b1 * gear**2, -b2 * gear**2
        return replace(made, position=place, position_gain=stiff, velocity_gain=damp)
    if b2:
        return replace(made, velocity=-force / (b2 * gear), velocity_gain=-b2 * gear**2)
    return replace(made, effort=gear * force)

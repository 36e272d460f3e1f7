"""Actuators of an MJCF on hinges, slides and tendons, as compiled by MuJoCo.

`general_actuator` has their law. The control u comes from the keyframe, or is zero. If an actuator
integrates its control, u is the integral at the start. If it filters it, u is the control. The
filter of muscles has controls from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.exchange import mjcf_actuator_places as places
from alf_ros.exchange import mjcf_force_ranges, mjcf_switches
from alf_ros.exchange.general_actuator import GeneralActuator
from alf_ros.exchange.robot import Robot


def reflect(mujoco: Any, model: Any) -> None:
    """Move damping and inertia of actuators, also of those that are off, to the coordinates of a
    model on which they are: times gear², as MuJoCo counts them."""
    kinds = mujoco.mjtTrn
    for n in range(places.count(model)):
        at, kind = int(model.actuator_trnid[n, 0]), int(model.actuator_trntype[n])
        if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
            to, at = 'dof', int(model.jnt_dofadr[at])
        elif kind == kinds.mjTRN_TENDON:
            to = 'tendon'
        else:
            continue
        gear = model.actuator_gear[places.output(model, n), 0]
        for what in ('damping', 'dampingpoly', 'armature'):
            own = getattr(model, f'actuator_{what}')[n]
            getattr(model, f'{to}_{what}')[at] += own * gear**2


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
    model, dynamics = data.model, mujoco.mjtDyn
    known = {
        dynamics.mjDYN_NONE: None,
        dynamics.mjDYN_INTEGRATOR: 'integrators of actuators',
        dynamics.mjDYN_FILTER: 'activation of actuators',
        dynamics.mjDYN_FILTEREXACT: 'activation of actuators',
        dynamics.mjDYN_MUSCLE: 'activation of actuators',
    }
    driving = []
    for n, name in enumerate(names):
        if mjcf_switches.is_off(mujoco, model, n):
            robot.leave('switched off in the file', name)
            continue
        on = _acts_on(mujoco, model, n, joints, tendons)
        fixed = model.actuator_gaintype[n] == mujoco.mjtGain.mjGAIN_FIXED
        fixed &= model.actuator_plugin[n] < 0  # which computes a force of its own
        fixed &= places.is_single(model, n)
        bias, dynamic = int(model.actuator_biastype[n]), int(model.actuator_dyntype[n])
        plain = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
        drive = None
        if on is not None and fixed and bias in plain and dynamic in known:
            actuator = _actuator(name, on, model, n, _input(mujoco, data, n), bias == plain[1])
            drive = actuator.drive
        if on is None or drive is None:
            robot.leave('actuators', name)
            continue
        if lost := known[dynamic]:
            robot.leave(lost, name)
        if model.actuator_delay[n]:
            robot.leave('activation of actuators', name)
        if actuator.is_lopsided:
            robot.leave('force ranges of actuators', name)
        if actuator.takes_targets_beyond:
            robot.leave('ranges of controls', name)
        driving.append(mjcf_force_ranges.Driving(drive, n, on.at, actuator.gear))
    robot.actuators += mjcf_force_ranges.within(robot, mujoco, data, joints, driving)


@dataclass(frozen=True)
class _Coordinate:
    """A joint or a tendon that an actuator pushes: its name, and its number in the model."""

    name: str
    at: int
    is_tendon: bool


@dataclass(frozen=True)
class _Input:
    """The u of an actuator, and its range."""

    value: float
    is_limited: bool
    ends: tuple[float, float]


def _acts_on(
    mujoco: Any, model: Any, n: int, joints: Sequence[str], tendons: Mapping[int, str]
) -> _Coordinate | None:
    """The hinge, slide or tendon that an actuator pushes, None for anything else."""
    kinds, at = mujoco.mjtTrn, int(model.actuator_trnid[n, 0])
    kind = int(model.actuator_trntype[n])
    if kind == kinds.mjTRN_TENDON and at in tendons:
        return _Coordinate(tendons[at], at, True)
    single = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        if int(model.jnt_type[at]) in single:
            return _Coordinate(joints[at], at, False)
    return None


def _input(mujoco: Any, data: Any, n: int) -> _Input:
    model, dynamics = data.model, mujoco.mjtDyn
    integrates = model.actuator_dyntype[n] == dynamics.mjDYN_INTEGRATOR
    at = places.control(model, n)
    value, is_limited = data.ctrl[at], model.actuator_ctrllimited[at]
    ends = model.actuator_ctrlrange[at]
    if is_limited:
        value = np.clip(value, *ends)
    if model.actuator_dyntype[n] == dynamics.mjDYN_MUSCLE:
        ends = np.clip(ends if is_limited else (0.0, 1.0), 0.0, 1.0)
        value, is_limited = np.clip(value, *ends), True
    if integrates:
        value, is_limited = data.act[model.actuator_actadr[n]], False
    if model.actuator_dyntype[n] != dynamics.mjDYN_NONE and model.actuator_actlimited[n]:
        is_limited, ends = True, model.actuator_actrange[n]
        value = np.clip(value, *ends)
    low, high = map(float, ends)
    return _Input(float(value), bool(is_limited), (low, high))


def _actuator(
    name: str, on: _Coordinate, model: Any, n: int, given: _Input, is_affine: bool
) -> GeneralActuator:
    b0, b1, b2 = map(float, model.actuator_biasprm[n, :3]) if is_affine else (0.0, 0.0, 0.0)
    low, high = map(float, model.actuator_forcerange[n])
    return GeneralActuator(
        name,
        on.name,
        float(model.actuator_gear[places.output(model, n), 0]),
        float(model.actuator_gainprm[n, 0]),
        (b0, b1, b2),
        given.value,
        given.ends if given.is_limited else None,
        (low, high) if model.actuator_forcelimited[n] else None,
        on.is_tendon,
    )

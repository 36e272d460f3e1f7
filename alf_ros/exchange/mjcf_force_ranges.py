"""Ranges of the force that all actuators together exert on a joint or a tendon of an MJCF.

A motor has a limit of its own, so the range of a sum is exact where one motor can stand for all
actuators: if no actuator has a limit. On a joint the sum counts with the gears, on a tendon
without.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alf_ros.exchange import mjcf_actuator_places as places
from alf_ros.exchange.robot import Actuator, Robot


@dataclass(frozen=True)
class Driving:
    """An actuator with no limit but its own.

    number: among the actuators of the model; at: of its joint or tendon.
    """

    actuator: Actuator
    number: int
    at: int
    gear: float


def within(
    robot: Robot, mujoco: Any, data: Any, joints: Sequence[str], all_driving: Sequence[Driving]
) -> list[Actuator]:
    """The actuators with the ranges of their joints and tendons; lists ranges that are not kept.

    joints: their names.
    """
    model = data.model
    groups: dict[tuple[bool, int], list[Driving]] = {}
    for each in all_driving:
        groups.setdefault((each.actuator.on_tendon, each.at), []).append(each)
    found: list[Actuator] = []
    for (on_tendon, at), group in groups.items():
        kind = 'tendon' if on_tendon else 'jnt'
        if not getattr(model, f'{kind}_actfrclimited')[at]:
            found += [each.actuator for each in group]
            continue
        low, high = map(float, getattr(model, f'{kind}_actfrcrange')[at])
        if not np.isclose(-low, high):
            for each in group:
                robot.leave('force ranges of actuators', each.actuator.name)
        most = max(-low, high)
        if math.isfinite(most):
            found += limited(robot, group, most)
        else:
            found += [each.actuator for each in group]
    for joint in _pulled(mujoco, data, all_driving):
        robot.leave('force ranges of joints', joints[joint])
    return found


def _pulled(mujoco: Any, data: Any, all_driving: Sequence[Driving]) -> list[int]:
    """Joints with a range that actuators on tendons move."""
    model = data.model
    pulling = [each.number for each in all_driving if each.actuator.on_tendon]
    if not pulling or not model.jnt_actfrclimited.any():
        return []
    for stage in (mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_transmission):
        stage(model, data)
    moved: set[int] = set()
    for n in pulling:
        row = places.output(model, n)
        first, count = int(data.moment_rowadr[row]), int(data.moment_rownnz[row])
        moved |= {int(model.dof_jntid[dof]) for dof in data.moment_colind[first : first + count]}
    return sorted(joint for joint in moved if model.jnt_actfrclimited[joint])


def limited(robot: Robot, group: Sequence[Driving], most: float) -> list[Actuator]:
    """Actuators of one joint or tendon, which exert `most` (N m or N) together."""
    on_tendon = group[0].actuator.on_tendon
    limits = [most * abs(each.gear) if on_tendon else most for each in group]
    own = [each.actuator.limit for each in group]
    if len(group) > 1:
        shares = [
            np.inf if value is None else value / limit
            for value, limit in zip(own, limits, strict=True)
        ]
        if sum(shares) <= 1.0:
            return [each.actuator for each in group]
        alike = len({each.gear for each in group}) == 1
        if own == [None] * len(group) and (alike or not on_tendon):
            robot.leave('actuators in one', ' and '.join(each.actuator.name for each in group))
            return [replace(_sum([each.actuator for each in group]), limit=limits[0])]
        robot.leave('force ranges of joints', group[0].actuator.joint)
    return [
        replace(each.actuator, limit=limit if value is None else min(value, limit))
        for each, value, limit in zip(group, own, limits, strict=True)
    ]


def _sum(actuators: Sequence[Actuator]) -> Actuator:
    """One actuator that exerts what all of them do, without a limit."""
    k_p = sum(each.position_gain for each in actuators)
    k_v = sum(each.velocity_gain for each in actuators)
    made = replace(
        actuators[0],
        effort=sum(each.effort for each in actuators),
        position=None,
        position_gain=k_p,
        velocity=None,
        velocity_gain=k_v,
    )
    if k_p:
        drawn = sum(each.position_gain * (each.position or 0.0) for each in actuators)
        made = replace(made, position=drawn / k_p)
    if any(each.velocity is not None for each in actuators):
        driven = sum(each.velocity_gain * (each.velocity or 0.0) for each in actuators)
        made = replace(made, velocity=driven / k_v)
    return made

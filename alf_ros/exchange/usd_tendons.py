"""Tendons of MuJoCo over joints in a USD stage: lengths Σ coef · x, with springs and losses.

Tendons through sites, and tendons of PhysX, are listed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from alf_ros.exchange.robot import Robot, Tendon
from alf_ros.exchange.usd_joints import UsdJoint
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage


def add(
    stage: UsdStage, scene: UsdScene, robot: Robot, joints: Sequence[UsdJoint]
) -> dict[str, str]:
    """Add the tendons over joints that are connected; list the others. Returns the names, by path.
    Raises InputError."""
    moving = {each.name for each in robot.connections}
    single = {str(j.prim.GetPath()): j.name for j in joints if j.degree and j.name in moving}
    found: dict[str, str] = {}
    for prim in stage.prims():
        if str(prim.GetTypeName()) != 'MjcTendon':
            continue
        name = prim.GetName()
        of = _joints(stage, prim, single)
        if of is None or name in found.values():
            robot.leave('tendons', name)
            continue
        found[str(prim.GetPath())] = name
        robot.tendons.append(_tendon(stage, scene, robot, prim, of))
    return found


def _joints(stage: UsdStage, prim: Any, single: dict[str, str]) -> dict[str, float] | None:
    """The joints of a tendon, each with its factor; None for another kind of tendon."""
    targets = stage.targets(prim, 'mjc:path')
    factors = stage.array(prim, 'mjc:path:coef', float)
    order = stage.array(prim, 'mjc:path:indices', int)
    if not order.size:
        order = np.arange(len(targets))
    if (
        stage.word(prim, 'mjc:type') != 'fixed'
        or stage.metre != 1.0
        or stage.kilogram != 1.0
        or factors.size != order.size
        or not np.isfinite(factors).all()
        or not all(0 <= n < len(targets) and targets[n] in single for n in order)
    ):
        return None
    of: dict[str, float] = {}
    for n, factor in zip(order, factors, strict=True):
        joint = single[targets[n]]
        of[joint] = of.get(joint, 0.0) + float(factor)
    return {joint: factor for joint, factor in of.items() if factor} or None


def _tendon(
    stage: UsdStage, scene: UsdScene, robot: Robot, prim: Any, of: dict[str, float]
) -> Tendon:
    joints = {each.name: each for each in robot.connections}
    drawn = sum(factor * joints[joint].drawn for joint, factor in of.items())
    low, high = (stage.number(prim, f'mjc:range:{end}') for end in ('min', 'max'))
    limited = stage.word(prim, 'mjc:limited', 'auto')
    has_range = limited == 'true' or (limited != 'false' and low < high)
    rest = stage.array(prim, 'mjc:springlength', float)
    first, last = (float(x) for x in (np.resize(rest, 2) if rest.size else (-1.0, -1.0)))
    if first == last == -1.0:  # the length where the springs of its joints rest
        first = last = sum(factor * joints[joint].rest for joint, factor in of.items())
    return Tendon(
        prim.GetName(),
        of,
        drawn=drawn,
        stiffness=scene.kept('springs', stage.number(prim, 'mjc:stiffness')),
        rest=(first, last),
        damping=scene.kept('damping', stage.number(prim, 'mjc:damping')),
        friction=scene.kept('dry friction', stage.number(prim, 'mjc:frictionloss')),
        limits=(low, high) if has_range and scene.kept('limits', 1.0) else None,
        armature=stage.number(prim, 'mjc:armature'),
    )

"""Mimic joints of PhysX in a USD stage, as couplings: x + gearing · y + offset = 0.

The schema `PhysxMimicJointAPI` stands at the joint x, with an instance for each freedom, and names
the joint y. An offset of an angle is in degrees. A coupling keeps the phase as drawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from alf_ros.exchange.robot import Coupled, Robot
from alf_ros.exchange.usd_joints import UsdJoint
from alf_ros.exchange.usd_stage import UsdStage

_SCHEMA = 'PhysxMimicJointAPI:'
_OFF = 1e-5  # rad, or parts of the length of a slide: seven digits are written


def couple(stage: UsdStage, robot: Robot, joints: Sequence[UsdJoint]) -> None:
    """Add the couplings of joints that are connected; list the mimics of other joints. Raises
    InputError."""
    moving = {each.name for each in robot.connections}
    single = {str(j.prim.GetPath()): j for j in joints if j.degree and j.name in moving}
    for joint in joints:
        schemas = stage.schemas(joint.prim)
        for instance in (s.removeprefix(_SCHEMA) for s in schemas if s.startswith(_SCHEMA)):
            other = single.get(_reference(joint, instance))
            if other is None or other is joint or str(joint.prim.GetPath()) not in single:
                robot.leave('mimic', joint.name)
            elif other.kind != joint.kind:
                robot.leave('mimic', f'{joint.name}, a {joint.kind} of a {other.kind}')
            elif any(each.name == _name(joint) for each in robot.couplings):
                robot.leave('mimic', f'{joint.name}, a second one')
            else:
                _add(stage, robot, joint, other, instance)


def _name(joint: UsdJoint) -> str:
    """Of the coupling of a joint."""
    return f'{joint.name}_mimic'


def _reference(joint: UsdJoint, instance: str) -> str:
    """The path of the joint that it mimics."""
    relation = joint.prim.GetRelationship(f'physxMimicJoint:{instance}:referenceJoint')
    targets = [str(each) for each in relation.GetForwardedTargets()] if relation else []
    return targets[0] if len(targets) == 1 else ''


def _add(stage: UsdStage, robot: Robot, joint: UsdJoint, other: UsdJoint, instance: str) -> None:
    gearing, offset = (
        stage.number(joint.prim, f'physxMimicJoint:{instance}:{name}')
        for name in ('gearing', 'offset')
    )
    unit = math.radians(1.0) if joint.kind == 'revolute' else stage.metre
    drawn = {each.name: each.drawn for each in robot.connections}
    x, y = drawn[joint.name], drawn[other.name]
    off = abs(x + gearing * y + unit * offset)
    if off > _OFF * max(1.0, abs(gearing)):
        robot.leave('phase of mimic', joint.name)
    of = {joint.name: 1.0} | ({other.name: gearing} if gearing else {})
    robot.couplings.append(Coupled(_name(joint), of))

"""Joints of a USD stage that move with another one, as couplings. A coupling keeps the phase as
drawn.

PhysX has x + gearing · y + offset = 0, an instance of `PhysxMimicJointAPI` at x for each freedom.
Newton and MuJoCo have x = c0 + c1 y (`NewtonMimicAPI`, `MjcEqualityJointAPI`). An offset of an
angle is in degrees, but `mjc:coef0` is in rad.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from alf_ros.exchange.robot import Coupled, Robot
from alf_ros.exchange.usd_joints import UsdJoint
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage

_PHYSX = 'PhysxMimicJointAPI:'
_EQUALITY = 'MjcEqualityJointAPI'
_OFF = 1e-5  # rad, or parts of the length of a slide: seven digits are written


@dataclass(frozen=True)
class _Mimic:
    """x + gearing · y + offset = 0 of a joint x and the one of the path `of`; rad or m."""

    joint: UsdJoint
    of: str
    gearing: float
    offset: float


def couple(stage: UsdStage, scene: UsdScene, robot: Robot, joints: Sequence[UsdJoint]) -> None:
    """Add the couplings of joints that are connected; list the mimics of other joints. Raises
    InputError."""
    moving = {each.name for each in robot.connections}
    single = {str(j.prim.GetPath()): j for j in joints if j.degree and j.name in moving}
    for joint in joints:
        mimics = [*_of_physx(stage, joint), *_linear(stage, scene, robot, joint)]
        for mimic in mimics:
            other = single.get(mimic.of)
            if other is None or other is joint or str(joint.prim.GetPath()) not in single:
                robot.leave('mimic', joint.name)
            elif other.kind != joint.kind:
                robot.leave('mimic', f'{joint.name}, a {joint.kind} of a {other.kind}')
            elif any(each.name == _name(joint) for each in robot.couplings):
                robot.leave('mimic', f'{joint.name}, a second one')
            else:
                _add(robot, mimic, other)


def _name(joint: UsdJoint) -> str:
    """Of the coupling of a joint."""
    return f'{joint.name}_mimic'


def _only(targets: Sequence[str]) -> str:
    return targets[0] if len(targets) == 1 else ''


def _unit(stage: UsdStage, joint: UsdJoint) -> float:
    return math.radians(1.0) if joint.kind == 'revolute' else stage.metre


def _of_physx(stage: UsdStage, joint: UsdJoint) -> Iterator[_Mimic]:
    schemas = stage.schemas(joint.prim)
    for instance in (s.removeprefix(_PHYSX) for s in schemas if s.startswith(_PHYSX)):
        prefix = f'physxMimicJoint:{instance}'
        gearing, offset = (
            stage.number(joint.prim, f'{prefix}:{name}') for name in ('gearing', 'offset')
        )
        of = _only(stage.targets(joint.prim, f'{prefix}:referenceJoint'))
        yield _Mimic(joint, of, gearing, _unit(stage, joint) * offset)


def _linear(stage: UsdStage, scene: UsdScene, robot: Robot, joint: UsdJoint) -> Iterator[_Mimic]:
    """The mimic of Newton or MuJoCo, if there is one and it is on."""
    prim, schemas = joint.prim, stage.schemas(joint.prim)
    is_equality = _EQUALITY in schemas
    leaders = stage.targets(prim, 'newton:mimicJoint') or stage.targets(prim, 'mjc:target')
    if not is_equality and 'NewtonMimicAPI' not in schemas:
        return
    is_on = stage.holds(prim, 'newton:mimicEnabled', True)
    if not is_on or (is_equality and scene.is_off('equalities')):
        robot.leave('switched off in the file', _name(joint))
        return
    if any(stage.number(prim, f'mjc:coef{n}') for n in (2, 3, 4)):
        robot.leave('equalities', _name(joint))
        return
    offset = _unit(stage, joint) * stage.number(prim, 'newton:mimicCoef0')
    if stage.is_authored(prim, 'mjc:coef0'):
        native = 1.0 if joint.kind == 'revolute' else stage.metre
        offset = native * stage.number(prim, 'mjc:coef0')
    factor = stage.number(prim, 'newton:mimicCoef1', 1.0)
    factor = stage.number(prim, 'mjc:coef1', factor)
    if is_equality:
        robot.leave('softness', _name(joint))
    yield _Mimic(joint, _only(leaders), -factor, -offset)


def _add(robot: Robot, mimic: _Mimic, other: UsdJoint) -> None:
    joint, gearing = mimic.joint, mimic.gearing
    drawn = {each.name: each.drawn for each in robot.connections}
    off = abs(drawn[joint.name] + gearing * drawn[other.name] + mimic.offset)
    if off > _OFF * max(1.0, abs(gearing)):
        robot.leave('phase of mimic', joint.name)
    of = {joint.name: 1.0} | ({other.name: gearing} if gearing else {})
    robot.couplings.append(Coupled(_name(joint), of))

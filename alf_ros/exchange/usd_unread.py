"""Content of a USD stage that no reader looks at: listed, never passed over.

These are attributes of physics engines that no reader knows, and values at times. Looked at are
the prims that take part in the motion: bodies, joints, articulations, scenes, actuators, tendons.
A value that changes nothing (zero, no limit, an empty text) is not listed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from alf_ros.exchange.robot import Robot
from alf_ros.exchange.usd_stage import ENDLESS, UsdStage

_SPACES = ('mjc:', 'newton:', 'physx', 'drive:')
# schemas and types of prims that take part, by parts of their names
_SCHEMAS = ('RigidBodyAPI', 'ArticulationRootAPI', 'ForceAPI', 'MjcBodyAPI')
_TYPES = ('Joint', 'PhysicsScene', 'MjcActuator', 'MjcTendon', 'NewtonActuator')

# what other modules read, or list themselves
_READ = (
    'mjc:(damping|stiffness|springref|springdamper|ref|armature|frictionloss|torqueScale)',
    'mjc:(coef[0-4]|flag:.*|compiler:angle|option:(density|viscosity|wind|actuatorgroupdisable))',
    'mjc:(gear|gainPrm|gainType|biasPrm|biasType|dynType|dynPrm|ctrl.*|force.*|act(Range|Limited).*)',
    'mjc:(actuatorfrc.*|path.*|sideSites.*|springlength|range:.*|limited|type|group|inertia)',
    'mjc:shellinertia|newton:(massModel|shellThickness|inertia|jointsAddMobility|gravityEnabled)',
    'newton:(armature|damping|friction|velocityLimit|mimic.*|kp|kd|ki|constEffort|maxEffort)',
    'newton:(delaySteps|integralMax|modelPath|targets|[a-zA-Z]+:(position|velocity))',
    'physxJoint:(armature|jointFriction|maxJointVelocity)|physxMimicJoint:.*|physxTendon.*',
    'physxRigidBody:(disableGravity|linearDamping|angularDamping)',
    'drive:.*:(type|stiffness|damping|maxForce|target(Position|Velocity))',
)
# what moves nothing: solvers, sleeping, and what only contact knows
_HARMLESS = (
    'mjc:(sol(ref|imp).*|condim|contype|conaffinity|priority|solmix|gap|maxhullvert|sleep|rgba)',
    'mjc:(option|compiler):.*|mjc:(width|lengthRange:.*|actDim|actEarly|crankLength|sdf.*)',
    'newton:(contact|sdf|hydroelastic|xpbd:|kamino:|mpm:|maxHull|rollingF|torsionalF).*',
    'newton:(maxSolverIterations|timeStepsPerSecond|collapse_fixed_joints|selfCollision.*)',
    'physx(Scene|Articulation|Collision|Material|ContactReport|Trigger|Cooked.*):.*',
    'physx(ConvexHull|ConvexDecomposition|TriangleMesh.*|SDFMesh|SphereFill)Collision:.*',
    'physxRigidBody:(solver.*|sleep.*|stabilization.*|retainAccelerations|cfmScale|solveContact)',
    'physxRigidBody:(maxDepenetrationVelocity|maxContactImpulse|contactSlop.*|enable.*CCD)',
    'physxJoint:(enable.*|projection.*)',
)
# kinds of the report, for values that are not neutral
_LISTED = {
    'velocities that are clamped': 'physxRigidBody:max[LA].*Velocity|drive:.*:maxVelocity',
    'soft limits': 'physxLimit:.*|newton:([a-zA-Z]+:)?limit(Stiffness|Damping)',
    'locked axes of bodies': 'physxRigidBody:locked(Pos|Rot)Axis',
    'compensation of gravity': 'mjc:(body:)?gravcomp|mjc:actuatorgravcomp',
    'margins of limits': 'mjc:margin',
    'masses that MuJoCo changes': 'mjc:compiler:(bound(Mass|Inertia)|setTotalMass|balanceInertia)',
}
_OTHER, _TIMES = 'attributes without a counterpart', 'values at times'
_KNOWN = re.compile('|'.join((*_READ, *_HARMLESS)))
_KINDS = {kind: re.compile(pattern) for kind, pattern in _LISTED.items()}
_SAMPLED = ('physics:', 'limit:', *_SPACES)
_PLACES = 'xformOp:'
_GYROSCOPIC = 'physxRigidBody:enableGyroscopicForces'


def leave(stage: UsdStage, robot: Robot, moving: Iterable[str]) -> None:
    """List such attributes; moving: the paths of the bodies. Raises InputError."""
    placing = {str(each) for path in moving for each in stage.prim(path).GetPath().GetPrefixes()}
    found: dict[tuple[str, str], list[str]] = {}
    states_mass = from_shapes = False
    for prim in stage.prims():
        if 'PhysicsRigidBodyAPI' in stage.schemas(prim):
            states_mass |= stage.is_authored(prim, 'physics:mass')
        from_shapes |= stage.word(prim, 'mjc:compiler:inertiaFromGeom') == 'true'
        unread = list(_sampled(prim, _PLACES)) if str(prim.GetPath()) in placing else []
        if _takes_part(prim, stage.schemas(prim)):
            unread += [*_sampled(prim, _SAMPLED), *_unread(prim)]
        for kind, name in unread:
            found.setdefault((kind, name), []).append(prim.GetName())
    if states_mass and from_shapes:  # which MuJoCo replaces by masses of shapes
        robot.leave('masses that MuJoCo changes', 'all')
    for (kind, name), prims in found.items():
        if kind not in (_OTHER, _TIMES):
            for each in prims:
                robot.leave(kind, each)
            continue
        more = f' and {len(prims) - 1} more' if len(prims) > 1 else ''
        robot.leave(kind, f'{name} of {prims[0]}{more}')


def _takes_part(prim: Any, schemas: Sequence[str]) -> bool:
    kind = str(prim.GetTypeName())
    return any(each in kind for each in _TYPES) or any(
        each in schema for schema in schemas for each in _SCHEMAS
    )


def _sampled(prim: Any, spaces: str | tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Attributes with values at times: the readers see the one without a time, or none."""
    for name in prim.GetAuthoredPropertyNames(lambda name: name.startswith(spaces)):
        attribute = prim.GetAttribute(name)
        if attribute and attribute.GetNumTimeSamples():
            yield _TIMES, name


def _unread(prim: Any) -> Iterator[tuple[str, str]]:
    """Kinds of the report, with the names of the attributes."""
    for name in prim.GetAuthoredPropertyNames(lambda name: name.startswith(_SPACES)):
        attribute = prim.GetAttribute(name)
        if not attribute:  # a relationship: those that count are read
            continue
        value = attribute.Get()
        if name == _GYROSCOPIC:
            if value is not None and not value:
                yield 'gyroscopic moments off', name
            continue
        if _is_neutral(value):
            continue
        kinds = [kind for kind, pattern in _KINDS.items() if pattern.fullmatch(name)]
        if kinds:
            yield kinds[0], name
        elif not _KNOWN.fullmatch(name):
            yield _OTHER, name


def _is_neutral(value: Any) -> bool:
    """Whether a value is zero, no limit, or nothing."""
    if value is None or isinstance(value, str):
        return value in (None, '', 'none', 'auto')
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return bool(np.all((numbers == 0.0) | (np.abs(numbers) >= ENDLESS)))

"""Joints of a USD stage: which freedoms each leaves open, and the joint type with these freedoms.

A joint has a frame on each of two bodies. In the frame of `physics:body0` three translations and
three rotations are open or locked. Two open rotations are in the order of PhysX: first about an
axis of body 0 (swing), then about the x axis of body 1 (twist).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.exchange.robot import GROUND, FramePose, Robot
from alf_ros.exchange.usd_bodies import UsdBodies, unique_names
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage

_TYPED = {
    'PhysicsRevoluteJoint': 'rot',
    'PhysicsPrismaticJoint': 'trans',
    'PhysicsSphericalJoint': 'ball',
    'PhysicsFixedJoint': 'fixed',
    'PhysicsDistanceJoint': 'distance',
    'PhysicsJoint': 'any',
}
# schemas of joints that are equalities in MuJoCo
EQUALITIES = ('MjcEqualityConnectAPI', 'MjcEqualityWeldAPI')
# what acts on the coordinate of a joint that has one
_SINGLE = (
    'physxJoint:armature',
    *(f'newton:{name}' for name in ('armature', 'damping', 'friction')),
    *(f'mjc:{name}' for name in ('armature', 'damping', 'frictionloss', 'stiffness')),
)
SLIDES, TURNS = ('transX', 'transY', 'transZ'), ('rotX', 'rotY', 'rotZ')


@dataclass(frozen=True)
class UsdEnd:
    """A body by its path, or the ground, and the frame of a joint in the world, as drawn."""

    body: str
    frame: FramePose


@dataclass(frozen=True, eq=False)
class UsdJoint:
    """A joint of a `kind` with the numbers of its axes, in the frames of both ends.

    axes: of a revolute, a prismatic or a cylindrical joint its axis, of a planar one the normal,
    of a universal one the axis of the first and of the second end. length: of a distance, m.
    degree: of a joint with one coordinate, the name of its freedom in the file. free: its freedoms
    there; a joint of the kind `general` has no type.
    """

    name: str
    prim: Any
    kind: str
    axes: tuple[int, ...]
    ends: tuple[UsdEnd, UsdEnd]
    degree: str = ''
    length: float = 0.0
    free: tuple[str, ...] = ()

    @property
    def slides_locked(self) -> tuple[int, ...]:
        """The directions of the first frame along which the second one does not move."""
        if self.kind == 'distance':
            return ()
        if self.kind in ('prismatic', 'cylindrical'):
            return tuple(n for n in range(3) if n != self.axes[0])
        return self.axes if self.kind == 'planar' else (0, 1, 2)

    @property
    def perpendicular(self) -> tuple[tuple[int, int], ...]:
        """Axes of the first and of the second frame that stay at right angles."""
        if self.kind in ('weld', 'prismatic'):
            return ((0, 1), (1, 2), (2, 0))
        if self.kind in ('revolute', 'cylindrical', 'planar'):
            (axis,) = self.axes
            return tuple((n, axis) for n in range(3) if n != axis)
        return ((self.axes[0], self.axes[1]),) if self.kind == 'universal' else ()

    @property
    def same(self) -> tuple[int, ...]:
        """Axes of both frames that coincide."""
        if self.kind in ('weld', 'prismatic'):
            return (0, 1, 2)
        return self.axes if self.kind in ('revolute', 'cylindrical', 'planar') else ()

    def coordinate(self, ends: tuple[FramePose, FramePose]) -> float:
        """Of a joint with one coordinate, rad or m, with its ends at these frames."""
        first, second = ends
        if self.kind == 'prismatic':
            along = first.turn[:, self.axes[0]]
            return float(along @ (second.origin - first.origin))
        between = first.turn.T @ second.turn
        j, k = (self.axes[0] + 1) % 3, (self.axes[0] + 2) % 3
        return math.atan2(between[k, j] - between[j, k], between[j, j] + between[k, k])


def joints(
    stage: UsdStage, scene: UsdScene, bodies: UsdBodies, robot: Robot
) -> Iterator[UsdJoint]:
    """The joints that hold something; the others are listed. Raises InputError."""
    reader, prims = _Reader(stage, scene, bodies, robot), dict[str, Any]()
    for prim in stage.prims():
        if str(prim.GetTypeName()) in _TYPED:
            prims[str(prim.GetPath())] = prim
        elif str(prim.GetTypeName()).endswith('Joint'):
            robot.leave('joints of unknown type', f'{prim.GetName()} ({prim.GetTypeName()})')
    for path, name in unique_names(prims).items():
        found = reader.joint(prims[path], name)
        if found is not None:
            yield found


def bounds(stage: UsdStage, prim: Any, prefix: str, names: tuple[str, str]) -> tuple[float, float]:
    """Lower and upper limit in units of the file, infinite where there is none. Raises
    InputError."""
    low, high = (
        stage.number(prim, prefix + name, default, endless=True)
        for name, default in zip(names, (-np.inf, np.inf), strict=True)
    )
    return low, high


class _Reader:
    def __init__(self, stage: UsdStage, scene: UsdScene, bodies: UsdBodies, robot: Robot) -> None:
        self._stage, self._scene, self._bodies, self._robot = stage, scene, bodies, robot

    def joint(self, prim: Any, name: str) -> UsdJoint | None:
        stage, robot = self._stage, self._robot
        if not stage.holds(prim, 'physics:jointEnabled', True):
            robot.leave('elements', f'joint {name}, which is not enabled')
            return None
        if any(each in EQUALITIES for each in stage.schemas(prim)):
            if self._scene.is_off('equalities'):
                robot.leave('switched off in the file', name)
                return None
            robot.leave('softness', name)
        ends = self._end(prim, '0'), self._end(prim, '1')
        if ends[0].body == ends[1].body:
            if ends[0].body != GROUND:
                message = f'both sides are of one body, {ends[0].body!r}'
                raise stage.error(str(prim.GetPath()), message)
            robot.leave('elements', f'joint {name} of fixed parts')
            return None
        if str(prim.GetTypeName()) == 'PhysicsDistanceJoint':
            return self._distance(prim, name, ends)
        free = self._free(prim)
        acts = self._acts(prim, free)
        if len(free) == 6 and not acts:
            robot.leave('elements', f'joint {name}, which leaves all motions free')
            return None
        found = kind_of(free)
        if found is None or (acts and is_chain(found[0], free)):
            turns = tuple(each for each in free if each in TURNS)
            if len(turns) == 3 or (len(turns) == 2 and 'rotX' not in turns):
                self._leave_dynamics(name, self._acts(prim, turns))
            self._leave(prim, name)
            return UsdJoint(name, prim, 'general', (), ends, free=free)
        kind, axes = found
        if kind == 'universal' and 'rotX' not in free:
            robot.leave('swings of two axes', name)
        degree = free[0] if kind in ('revolute', 'prismatic') else ''
        self._leave(prim, name)
        if not degree:
            self._leave_dynamics(name, acts)
        return UsdJoint(name, prim, kind, axes, ends, degree, free=free)

    def _distance(self, prim: Any, name: str, ends: tuple[UsdEnd, UsdEnd]) -> UsdJoint | None:
        low, high = (
            self._stage.number(prim, f'physics:{key}Distance', -1.0, endless=True)
            for key in ('min', 'max')
        )
        if low <= 0.0 and (high < 0.0 or high == np.inf):
            self._robot.leave('elements', f'joint {name}, which limits no distance')
        elif high == 0.0:
            return UsdJoint(name, prim, 'spherical', (), ends)
        elif low == high:
            return UsdJoint(name, prim, 'distance', (), ends, length=low * self._stage.metre)
        else:
            self._robot.leave('distances with play', name)
        return None

    def _end(self, prim: Any, side: str) -> UsdEnd:
        """The body of a side and the frame there; without a body the world."""
        stage, path = self._stage, str(prim.GetPath())
        targets = stage.targets(prim, f'physics:body{side}')
        if len(targets) > 1:
            raise stage.error(f'{path} body{side}', 'more than one body', value=targets[1])
        place = stage.numbers(prim, f'physics:localPos{side}', (0.0, 0.0, 0.0))
        turn = stage.quaternion(prim, f'physics:localRot{side}')
        if not targets:
            return UsdEnd(GROUND, FramePose(stage.metre * place, turn))
        target = stage.prim(targets[0])
        if not target or not self._bodies.knows(targets[0]):
            raise stage.error(f'{path} body{side}', 'no such prim', value=targets[0])
        matrix, origin = stage.affine(target)
        frame = FramePose(origin + matrix @ place, stage.frame(target).turn @ turn)
        return UsdEnd(self._bodies.owner(targets[0]), frame)

    def _free(self, prim: Any) -> tuple[str, ...]:
        """The freedoms that a joint leaves open, translations first."""
        kind = _TYPED[str(prim.GetTypeName())]
        if kind == 'fixed':  # one that exerts no torque is a ball
            return () if self._stage.number(prim, 'mjc:torqueScale', 1.0) else TURNS
        if kind == 'ball':
            return TURNS
        if kind == 'any':
            return tuple(each for each in (*SLIDES, *TURNS) if not self._is_locked(prim, each))
        return (kind + self._stage.choice(prim, 'physics:axis', 'X', tuple('XYZ')),)

    def _is_locked(self, prim: Any, degree: str) -> bool:
        if f'PhysicsLimitAPI:{degree}' not in self._stage.schemas(prim):
            return False
        low, high = bounds(self._stage, prim, f'limit:{degree}:physics:', ('low', 'high'))
        return low > high or low == high == 0.0

    def _acts(self, prim: Any, free: tuple[str, ...]) -> bool:
        """Whether the coordinates of a joint have limits, drives or forces."""
        stage, schemas = self._stage, self._stage.schemas(prim)
        cones = (
            stage.number(prim, f'physics:coneAngle{n}Limit', -1.0, endless=True) for n in (0, 1)
        )
        return (
            any(0.0 <= x < np.inf for x in cones)
            or any(f'PhysicsDriveAPI:{each}' in schemas for each in free)
            or any(stage.number(prim, each) for each in _SINGLE)
            or any(f'PhysicsLimitAPI:{e}' in schemas and self._is_limited(prim, e) for e in free)
        )

    def _is_limited(self, prim: Any, degree: str) -> bool:
        ends = bounds(self._stage, prim, f'limit:{degree}:physics:', ('low', 'high'))
        return ends != (-np.inf, np.inf)

    def _leave_dynamics(self, name: str, acts: bool) -> None:
        if acts:
            self._robot.leave('limits, damping, friction, springs, armature', name)

    def _leave(self, prim: Any, name: str) -> None:
        """List effects in a joint that have no counterpart here."""
        stage, leave = self._stage, self._robot.leave
        for key in ('physics:breakForce', 'physics:breakTorque'):
            if stage.number(prim, key, np.inf, endless=True) < np.inf:
                leave('breaking of joints', name)
        if stage.number(prim, 'physxJoint:jointFriction'):
            leave('friction coefficients of PhysX', name)
        for key in ('physxJoint:maxJointVelocity', 'newton:velocityLimit'):
            if stage.number(prim, key, np.inf, endless=True) < np.inf:
                leave('velocities that are clamped', name)


def is_chain(kind: str, free: tuple[str, ...]) -> bool:
    """Whether a joint of a type is also a chain of joints with one coordinate each."""
    return kind in ('cylindrical', 'planar') or (kind == 'universal' and 'rotX' in free)


def kind_of(free: tuple[str, ...]) -> tuple[str, tuple[int, ...]] | None:
    """The joint type with these freedoms, and its axes; None if there is none."""
    slides, turns = (
        tuple(n for n, each in enumerate(of) if each in free) for of in (SLIDES, TURNS)
    )
    if not slides:
        universal = turns[1:] + turns[:1] if 0 in turns else turns
        kinds = ('weld', ()), ('revolute', turns), ('universal', universal), ('spherical', ())
        return kinds[len(turns)]
    if len(slides) == 1 and turns in ((), slides):
        return 'cylindrical' if turns else 'prismatic', slides
    if len(slides) == 2 and len(turns) == 1 and turns[0] not in slides:
        return 'planar', turns
    return None

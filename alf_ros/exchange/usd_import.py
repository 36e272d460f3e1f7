"""USD to a robot: rigid bodies where they are drawn, and joints of any graph between them.

The schemas of UsdPhysics define bodies, joints, drives and mass, and the package usd-core composes
the stage. Its parser of physics rounds to single precision, so the attributes are read here. The
world has the axes of the stage: gravity acts along its down axis unless a scene sets it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import (
    usd_actuators,
    usd_dynamics,
    usd_mimics,
    usd_posture,
    usd_stacks,
    usd_states,
    usd_tendons,
    usd_unread,
    usd_visuals,
)
from alf_ros.exchange.robot import GROUND, BodyVelocity, Connection, FramePose, Robot, RobotPart
from alf_ros.exchange.usd_bodies import UsdBodies
from alf_ros.exchange.usd_joints import UsdJoint, joints
from alf_ros.exchange.usd_rounding import Triples
from alf_ros.exchange.usd_scene import UsdScene
from alf_ros.exchange.usd_stage import UsdStage, guarded

_ROUNDED = 1e-6  # by how much single precision moves axes and, of the size, places
_NO_BODY = ': no prim is a rigid body (PhysicsRigidBodyAPI)'
_STILL = ': every rigid body is fixed, kinematic or not enabled'
_ELSEWHERE = ('Deformable', 'Particle')  # parts of the names of schemas of soft matter


def read(path: Path, positions: Mapping[str, float]) -> Robot:
    """The robot of a file. Raises InputError."""
    if positions:
        message = 'not for USD, which places each body: change the transformation of bodies'
        raise InputError(message, key='--set', value=next(iter(positions)))
    with guarded(path):
        return _Reader(UsdStage(path)).robot


class _Reader:
    """Bodies first, then the joints between them, then what shows them."""

    def __init__(self, stage: UsdStage) -> None:
        self.stage = stage
        self.robot = Robot(stage.name, stage.file, (), _STILL)
        for line in stage.missing:
            self.robot.leave('includes', line)
        self.scene = UsdScene(stage, self.robot)
        self.robot.gravity = self.scene.gravity
        self.bodies = UsdBodies(stage, self.robot)
        if not self.bodies.prims:
            if not self.bodies.any_body:
                self.robot.still = _NO_BODY
            return
        drawn = {path: self.bodies.part(path) for path in self.bodies.prims}
        found = list(joints(stage, self.scene, self.bodies, self.robot))
        found, between = usd_stacks.chained(stage, found, self.bodies.names)
        places = {path: part.origin for path, part in (drawn | between).items()}
        self.motion = usd_posture.motions(self.robot, found, places)
        self.links = {path: _moved(part, self.motion[path]) for path, part in drawn.items()}
        self.part_of = self._add_parts(self.links, found)
        for key, part in between.items():
            self.robot.parts.append(_moved(part, self.motion[key]))
            self.part_of[key] = part.name
        ends = [end.frame.origin for joint in found for end in joint.ends]
        size = float(np.ptp([*ends, *places.values()], axis=0).max())
        self.axes, self.met = Triples(_ROUNDED), Triples(_ROUNDED * size)
        for joint in found:
            self._connect(joint)
        tendons = usd_tendons.add(stage, self.scene, self.robot, found)
        usd_mimics.couple(stage, self.scene, self.robot, found)
        usd_actuators.add(stage, self.scene, self.robot, found, tendons)
        self.weightless: set[str] = set()
        self._leave()
        self.robot.lift(self.links, self.part_of, self.weightless)
        usd_unread.leave(stage, self.robot, self.bodies.prims)

    # ------------------------------------------------------------------------- bodies and joints

    def _add_parts(
        self, links: Mapping[str, RobotPart], found: Sequence[UsdJoint]
    ) -> dict[str, str]:
        """Add the parts, each of all bodies that are fixed to each other. Returns the part of each
        body."""
        above = {path: path for path in links} | {GROUND: GROUND}

        def root(path: str) -> str:
            while above[path] != path:
                path = above[path]
            return path

        for joint in found:
            if joint.kind == 'weld':
                one, other = (root(end.body) for end in joint.ends)
                if other == GROUND:  # which stays a root
                    one, other = other, one
                above[other] = one
        return self.robot.add_links(links, {path: root(path) for path in above})

    def _connect(self, joint: UsdJoint) -> None:
        parent, child = (self.part_of[end.body] for end in joint.ends)
        if joint.kind == 'weld':
            return
        if parent == child:
            self.robot.leave('elements', f'joint {joint.name} inside {parent}')
            return
        first, second = (self.motion[end.body] @ end.frame for end in joint.ends)
        place = self.met.same(second.origin)
        made = Connection(joint.name, joint.kind, parent, child, place)
        if joint.kind == 'distance':
            made = replace(made, start=first.origin, length=joint.length)
        elif joint.kind == 'universal':
            one, other = first.turn[:, joint.axes[0]], second.turn[:, joint.axes[1]]
            across = other - (other @ one) * one  # as far as single precision has it
            made = replace(made, axes=(one, across / np.linalg.norm(across)))
        elif joint.axes:
            made = replace(made, axes=(self._axis(first.turn[:, joint.axes[0]]),))
        if joint.degree:
            made = self._with_dynamics(made, joint, (first, second))
        else:
            usd_states.leave_several(self.stage, self.robot, joint)
        usd_dynamics.add_actuators(self.stage, self.robot, joint)
        self.robot.connect(made)

    def _axis(self, axis: Floats) -> Floats:
        """An axis, or the parallel one that it was before rounding."""
        opposite = self.axes.find(-axis)
        return self.axes.same(axis) if opposite is None else -opposite

    def _with_dynamics(
        self, made: Connection, joint: UsdJoint, ends: tuple[FramePose, FramePose]
    ) -> Connection:
        limits = usd_dynamics.limits(self.stage, self.scene, joint)
        drawn = joint.coordinate(ends) + usd_dynamics.reference(self.stage, self.scene, joint)
        if joint.kind == 'revolute':
            drawn = usd_dynamics.in_range(drawn, limits)
        size = 1.0 if joint.kind == 'revolute' else float(np.abs(made.place).max())
        if abs(drawn) <= _ROUNDED * size:
            drawn = 0.0
        else:
            self.robot.leave('zero of joints', f'{joint.name} at {drawn:.12g}')
        usd_states.leave(self.stage, self.robot, joint, drawn)
        made = replace(made, drawn=drawn, limits=limits)
        return usd_dynamics.with_passive(self.stage, self.scene, self.robot, joint, made)

    # ----------------------------------------------------------------------------------- the rest

    def _leave(self) -> None:
        """Show the shapes, and list the other contents of the file."""
        stage, leave = self.stage, self.robot.leave
        for prim in stage.prims():
            path, name = str(prim.GetPath()), prim.GetName()
            owner = self.bodies.owner(path)
            part = self.part_of[owner]
            usd_visuals.add(stage, self.robot, prim, part, self.motion[owner])
            schemas = stage.schemas(prim)
            collides = 'PhysicsCollisionAPI' in schemas
            if collides and stage.holds(prim, 'physics:collisionEnabled', True):
                leave('contact in USD', part)
            if owner == path:
                self._leave_body(prim, part)
            if any('Tendon' in each for each in schemas):
                leave('tendons', name)
            if any(each in schema for schema in schemas for each in _ELSEWHERE):
                leave('flex', name)
            if str(prim.GetTypeName()).endswith('Light'):
                leave('lights', name)
            if str(prim.GetTypeName()) == 'PointInstancer' and self._places_bodies(prim):
                leave('instances of points', name)
            if str(prim.GetTypeName()) == 'MjcKeyframe':
                leave('keyframes', name)
            if str(prim.GetTypeName()) == 'Camera':
                leave('cameras', name)

    def _places_bodies(self, instancer: Any) -> bool:
        within = tuple(f'{each}/' for each in self.stage.targets(instancer, 'prototypes'))
        return any(f'{path}/'.startswith(within) for path in self.bodies.prims)

    def _leave_body(self, prim: Any, part: str) -> None:
        stage, leave = self.stage, self.robot.leave
        if stage.holds(prim, 'physxRigidBody:disableGravity', False):
            self.weightless.add(str(prim.GetPath()))
        if stage.holds(prim, 'physics:startsAsleep', False):
            leave('sleeping bodies', part)
        if any(
            stage.number(prim, f'physxRigidBody:{kind}Damping') for kind in ('linear', 'angular')
        ):
            leave('damping of bodies', part)
        turn, slide = (
            stage.numbers(prim, f'physics:{name}', (0.0, 0.0, 0.0))
            for name in ('angularVelocity', 'velocity')
        )
        if part != GROUND and (turn.any() or slide.any()):
            path = str(prim.GetPath())
            above, moved = stage.parent(prim), self.motion[path].turn
            axes = stage.rotation(above, path)
            linear, angular = moved @ above @ slide, moved @ axes @ np.radians(turn)
            com = self.links[path].com
            self.robot.velocities.setdefault(part, BodyVelocity(com, linear, angular))


def _moved(part: RobotPart, motion: FramePose) -> RobotPart:
    """A part after a motion in the world."""
    J = motion.turn @ part.inertia @ motion.turn.T
    origin, com = motion.place(part.origin), motion.place(part.com)
    return replace(part, origin=origin, com=com, inertia=J)

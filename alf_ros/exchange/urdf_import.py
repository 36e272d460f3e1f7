"""The tree of a URDF to a robot; `urdf_loops` and `loop_file` close its loops.

urdf_parser_py, which ROS 2 brings, reads it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.exchange import (
    urdf_actuators,
    urdf_document,
    urdf_elements,
    urdf_gazebo,
    urdf_joint_types,
    urdf_motions,
    urdf_visuals,
)
from alf_ros.exchange.robot import GROUND, STILL, Connection, Coupled, FramePose, Robot, RobotPart
from alf_ros.exchange.sdf_values import numbers
from alf_ros.exchange.urdf_document import WORLD
from alf_ros.exchange.urdf_motions import TreeMotion
from alf_ros.mechanism import GROUND as GROUND_IN_FILES

_TREE = {'revolute': 'revolute', 'continuous': 'revolute', 'prismatic': 'prismatic'}
_MOVES = urdf_motions.SINGLE
_TREE |= {'planar': 'planar'}  # and `fixed` and `floating`, which are no joints
_SEVERAL = ('planar', 'floating')  # types with several coordinates
_LIMITED = ('revolute', 'prismatic')  # types that have limits
_GRAVITY = (0.0, 0.0, -9.81)
_OFF = 1e-9  # rad or m: how far a joint that mimics may be drawn from where the other has it
_ROUNDED = 1e-12  # rad or m: a position that an export has for zero
_STILL = ': with --floating its root link moves'


class UrdfReader:
    """The tree of a URDF, its links placed; `robot` is what it becomes.

    positions: of joints, rad or m, zero where absent. The root is fixed unless `floating`.
    arguments: of a xacro. types: of joints that are of another type (`urdf_joint_types`).
    follows: joints that follow from loops, so that their <mimic> does not count. geared: mimics
    of gearboxes, as in `mimics`. `sprung`: joints with a spring. Raises InputError.
    """

    def __init__(
        self,
        path: Path,
        positions: Mapping[str, float],
        floating: bool,
        arguments: Mapping[str, str] | None = None,
        types: Mapping[str, str] | None = None,
        follows: Collection[str] = (),
        geared: Mapping[str, tuple[str, float, float]] | None = None,
    ) -> None:
        self.file = str(path)
        document = urdf_document.read(path, arguments, types or {})
        self.xml, self.urdf, self._threads = document.xml, document.robot, document.threads
        self._named: dict[tuple[str, str | None], list[ElementTree.Element]] = {}
        for each in self.xml:
            self._named.setdefault((each.tag, each.get('name')), []).append(each)
        self._balls = {
            name: tuple(part.name for part in row)
            for name, row in document.rows.items()
            if document.kinds[name] == urdf_joint_types.BALL
        }
        self._screws = {name: (name, each.slide) for name, each in self._threads.items()}
        self._endless = urdf_joint_types.slides(document.rows, self._threads)
        self._follows = follows
        self.robot = Robot(self.urdf.name, self.file, _GRAVITY, _STILL)
        for kind, name in document.absent:
            self.robot.leave(kind, name)
        self.joints = {joint.name: joint for joint in self.urdf.joints}
        self.links = {link.name: link for link in self.urdf.links}
        for name in positions:
            if urdf_motions.PART in name:  # of a joint with several, which --set cannot name
                continue
            if name not in self.joints:
                raise InputError('no such joint', key='--set', value=name, choices=self.joints)
            if self.joints[name].type not in _MOVES:
                raise InputError('not a joint with one coordinate', key='--set', value=name)
        self.mimics = self._mimics() | dict(geared or {})
        self.positions = self.drawn(positions)
        for kind, things, count in (
            ('joint', self.joints, len(self.urdf.joints)),
            ('link', self.links, len(self.urdf.links)),
        ):
            if len(things) < count:
                name = next(name for name in things if len(self._named[kind, name]) > 1)
                raise self.error(name, f'a name of two {kind}s', self._at(kind, name, -1))
        self._above: dict[str, Any] = {}
        self.part_of: dict[str, str] = {}
        self._order = self._ordered(floating)
        self.poses = self.poses_at(self.positions)
        rows = (*self._balls.values(), *self._screws.values())
        inner = {self.joints[each].child for row in rows for each in row[:-1]}
        self.part_of = {name: part for name, part in self.part_of.items() if name not in inner}
        parts = {
            name: self._part(name, link) for name, link in self.links.items() if name not in inner
        }
        self.part_of = self.robot.add_links(parts, self.part_of)
        self.robot.lift(parts, self.part_of, urdf_gazebo.weightless(self.xml, self.error))
        self._armatures = urdf_actuators.armatures(self.robot, self.xml)
        in_rows = {each for row in self._balls.values() for each in row}
        in_rows |= {slide for _, slide in self._screws.values()}
        self._springs = urdf_gazebo.springs(self.xml, self.error)
        single = {name for name, joint in self.joints.items() if joint.type in _MOVES}
        self.sprung = self._springs.keys() & (single - in_rows - self._screws.keys())
        for joint in self.urdf.joints:
            if joint.name not in in_rows:
                self._connect(joint)
        for name, row in self._balls.items():
            self._connect_ball(name, row, document.damping.get(name, 0.0))
        self._couple()
        limits = {
            name: joint.limit.effort or None if joint.limit is not None else None
            for name, joint in self.joints.items()
            if joint.type in _MOVES
        }
        urdf_actuators.add(self.robot, self.xml, limits)
        moved = {each.name for each in self.robot.connections} & set(limits)
        urdf_actuators.leave(self.robot, self.xml, self.mimics, self._armatures.keys() & moved)
        urdf_visuals.add(self.robot, self.xml, path.parent, self.poses, self.part_of)
        self._leave()

    def error(
        self, key: str, message: str, at: ElementTree.Element | None = None, **details: Any
    ) -> InputError:
        """Return an InputError with file, line and key, see `Robot.error`."""
        return self.robot.error(key, message, at, **details)

    def _at(self, tag: str, name: str, which: int = 0) -> ElementTree.Element | None:
        """The link or the joint of a name in the file, the first one of several or another."""
        found = self._named.get((tag, name))
        return found[which] if found else None

    def unit(self, key: str, axis: Any, at: ElementTree.Element | None) -> Floats:
        """A direction; x where none is given, as the format says. at: the element that has it.
        Raises InputError."""
        u = np.array((1.0, 0.0, 0.0) if axis is None else axis, dtype=float)
        size = float(np.linalg.norm(u))
        if not size > 0.0:
            raise self.error(key, 'zero is no direction', at)
        return u / size

    # ---------------------------------------------------------------------- where joints are drawn

    def _mimics(self) -> dict[str, tuple[str, float, float]]:
        """By joint: the one that it mimics, the multiplier, the offset (rad, m)."""
        found = {}
        for name, joint in self.joints.items():
            each = joint.mimic
            if each is not None and joint.type in _SEVERAL:
                self.robot.leave('mimic', name)
            if each is None or joint.type not in _MOVES:
                continue
            if name in self._follows:
                self.robot.leave('mimic that loops imply', name)
                continue
            other = self.joints.get(each.joint)
            if other is None:
                self.robot.leave('mimic', f'{name}, for there is no {each.joint!r}')
                continue
            if other.type in _SEVERAL:
                self.robot.leave('mimic', f'{name}, for {each.joint!r} has several coordinates')
                continue
            factor = 1.0 if each.multiplier is None else float(each.multiplier)
            found[name] = each.joint, factor, float(each.offset or 0.0)
        return found

    def drawn(self, given: Mapping[str, float]) -> dict[str, float]:
        """Positions of joints: given, from <ros2_control>, and from mimics. Raises InputError."""
        positions = {**self._initial(), **given}
        for name in self.mimics:
            x = self.mimicked(name, positions)
            if name in given and abs(given[name] - x) > _OFF:
                message = f'{name!r} mimics {self.mimics[name][0]!r}, which has it at {x:.9g}'
                raise InputError(message, key='--set or side file', value=given[name])
        return positions | {name: self.mimicked(name, positions) for name in self.mimics}

    def _initial(self) -> dict[str, float]:
        """Positions (rad, m) that <ros2_control> gives joints with one coordinate."""
        found = {}
        for name, several in urdf_actuators.initial_positions(self.xml).items():
            if name not in self.joints:
                continue
            first, *others = (
                float(numbers(at.text or '', 1, self.error, name, at)[0]) for at in several
            )
            if self.joints[name].type in _MOVES:
                found[name] = first
            elif first:
                self.robot.leave('positions of joints', name)
            if any(each != first for each in others):
                self.robot.leave('attributes that disagree', f'initial_value of {name}')
        for name in self.mimics:
            x = self.mimicked(name, found)
            if abs(found.get(name, x) - x) > _OFF:
                self.robot.leave('positions of joints', name)
        return found

    def mimicked(self, name: str, positions: Mapping[str, float]) -> float:
        """Where a joint is (rad, m), from the positions of those that do not mimic, however long
        the chain of those between is. Raises InputError if it mimics itself."""
        chain: dict[str, tuple[float, float]] = {}
        while name in self.mimics:
            if name in chain:
                raise self.error(name, 'it mimics itself', self._at('joint', name))
            other, factor, offset = self.mimics[name]
            chain[name] = factor, offset
            name = other
        x = positions.get(name, 0.0)
        for factor, offset in reversed(chain.values()):
            x = factor * x + offset
        return x

    def _couple(self) -> None:
        """A coupling for each joint that mimics one that moves; else it holds its place."""
        for name, (other, factor, _) in self.mimics.items():
            if (other, name) in self._screws.values():
                continue
            moves = factor != 0.0 and self.joints[other].type in _MOVES
            of = {name: 1.0} | ({other: -factor} if moves else {})
            self.robot.couplings.append(Coupled(f'{name}_mimic', of))

    # -------------------------------------------------------------------------------------- tree

    def _ordered(self, floating: bool) -> list[str]:
        """The links, each after the one that it hangs from; `part_of` says which move as one."""
        for joint in self.urdf.joints:
            for link in (joint.parent, joint.child):
                if link not in self.links:
                    at, choices = self._at('joint', joint.name), self.links
                    raise self.error(joint.name, 'no such link', at, value=link, choices=choices)
            if joint.child in self._above:
                first = self._above[joint.child].name
                message = f'{joint.child!r} is a child of {first} already: close loops otherwise'
                raise self.error(joint.name, message, self._at('joint', joint.name))
            self._above[joint.child] = joint
        for name in self.links:
            chain = [name]
            while chain[-1] in self._above and chain[-1] not in self.part_of:
                chain.append(self._above[chain[-1]].parent)
                if len(chain) > len(self.links) + 1:
                    raise self.error(name, 'this link is its own ancestor', self._at('link', name))
            if chain[-1] not in self.part_of:
                moves = floating and chain[-1] != WORLD
                self.part_of[chain[-1]] = chain[-1] if moves else GROUND
            for link in reversed(chain[:-1]):
                joint = self._above[link]
                fixed = joint.type == 'fixed'
                self.part_of[link] = self.part_of[joint.parent] if fixed else link
        return list(self.part_of)

    def poses_at(self, positions: Mapping[str, float]) -> dict[str, FramePose]:
        """Poses of all links in the frame of the root, at positions of joints (rad, m), zero where
        absent."""
        poses: dict[str, FramePose] = {}
        for link in self._order:
            joint = self._above.get(link)
            pose = STILL if joint is None else self.pose_of(joint, positions)
            poses[link] = pose if joint is None else poses[joint.parent] @ pose
        return poses

    def motions(self, joint: Any) -> list[TreeMotion]:
        """The motions of a joint, one after the other; a joint that is fixed has none."""
        if joint.type not in urdf_motions.TYPES:  # its axis may be any, zero as well
            return []
        turns = joint.type != 'floating'
        return urdf_motions.of(joint.name, joint.type, self._axis(joint) if turns else None)

    def _axis(self, joint: Any) -> Floats:
        return self.unit(joint.name, joint.axis, self._at('joint', joint.name))

    def pose_of(self, joint: Any, positions: Mapping[str, float]) -> FramePose:
        """Of the child's frame in the parent's, at positions of joints (rad, m)."""
        pose = _pose(joint.origin)
        for motion in self.motions(joint):
            pose = motion.moved(pose, positions.get(motion.name, 0.0))
        return pose

    def _part(self, name: str, link: Any) -> RobotPart:
        pose = self.poses[name]
        J: Floats = np.zeros((3, 3))
        inertial = link.inertial
        if inertial is None or not (inertial.mass or inertial.inertia):
            return RobotPart(name, pose.origin, 0.0, pose.origin, J)
        frame = pose @ _pose(inertial.origin)
        if inertial.inertia is None:
            self.robot.leave('inertia: there is none', name)
        else:
            J = np.array(inertial.inertia.to_matrix(), dtype=float)
        turned = frame.turn @ J @ frame.turn.T
        mass, given = float(inertial.mass or 0.0), self._at('link', name)
        at = None if given is None else given.find('inertial')
        return RobotPart(name, pose.origin, mass, frame.origin, turned, at)

    def _connect(self, joint: Any) -> None:
        dynamics = joint.dynamics
        if joint.type in _SEVERAL and dynamics is not None:
            if dynamics.damping or dynamics.friction:
                self.robot.leave('limits, damping, friction, springs, armature', joint.name)
            dynamics = None
        if joint.type in ('fixed', 'floating'):
            return
        stiffness, rest = self._springs[joint.name] if joint.name in self.sprung else (0.0, 0.0)
        pitch = self._threads[joint.name].pitch if joint.name in self._threads else 0.0
        last = self.joints[self._screws[joint.name][-1]] if joint.name in self._screws else joint
        pose = self.poses[last.child]
        turns = joint.limit is not None and joint.type in _LIMITED
        drawn = self.positions.get(joint.name, 0.0)
        if abs(drawn) > _ROUNDED:
            self.robot.leave('zero of joints', f'{joint.name} at {drawn:.12g}')
        self.robot.connect(
            Connection(
                joint.name,
                'screw' if pitch else _TREE[joint.type],
                self.part_of[joint.parent],
                self.part_of[last.child],
                pose.origin,
                (pose.turn @ self._axis(joint),),
                drawn,
                (joint.limit.lower or 0.0, joint.limit.upper or 0.0) if turns else None,
                float(dynamics.damping or 0.0) if dynamics is not None else 0.0,
                stiffness=stiffness,
                rest=rest,
                friction=float(dynamics.friction or 0.0) if dynamics is not None else 0.0,
                pitch=pitch,
                armature=self._armatures.get(joint.name, 0.0),
            ),
            at=self._at('joint', joint.name),
        )

    def _connect_ball(self, name: str, row: tuple[str, ...], damping: float) -> None:
        first, last = (self.joints[each] for each in (row[0], row[-1]))
        parent, child = self.part_of[first.parent], self.part_of[last.child]
        place = self.poses[last.child].origin
        ball = Connection(name, 'spherical', parent, child, place, damping=damping)
        self.robot.connect(ball, at=self._at('joint', row[0]))

    def part(
        self, link: str, key: str, at: ElementTree.Element | None = None
    ) -> tuple[str, FramePose]:
        """The part that a link of a loop belongs to, and the link's pose. at: the element that
        names it. Raises InputError."""
        if link in (GROUND_IN_FILES, 'world') and link not in self.links:
            return GROUND, STILL
        if link not in self.links:
            raise self.error(key, 'no such link', at, value=link, choices=self.links)
        return self.part_of[link], self.poses[link]

    # ----------------------------------------------------------------------------------- the rest

    def _leave(self) -> None:
        """Note the other contents of the file."""
        roots = [link for link in self._order if link not in self._above and link != 'world']
        for link in roots if len(roots) > 1 else ():
            self.robot.leave('several root links', link)
        pushed = {actuator.joint for actuator in self.robot.actuators}
        for joint in self.urdf.joints:
            for kind in ('calibration', 'safety_controller'):
                if getattr(joint, kind, None) is not None:
                    self.robot.leave(kind, joint.name)
            limit = joint.limit
            if limit is None and joint.type in _LIMITED and joint.name not in self._endless:
                self.robot.leave('limits: there are none', joint.name)
            if limit is not None and limit.velocity:
                self.robot.leave('limits of velocity', joint.name)
            if limit is not None and limit.effort and joint.name not in pushed:
                self.robot.leave('limits of effort', joint.name)
            elif limit is not None and not limit.effort and joint.name in pushed:
                self.robot.leave('limits of effort', f'{joint.name} is 0: its motor has none')
        urdf_elements.leave_unknown(self.robot, self.xml)


def _pose(origin: Any) -> FramePose:
    if origin is None:
        return STILL
    rpy = origin.rpy or (0.0, 0.0, 0.0)
    turn = Rotation.from_euler('xyz', rpy).as_matrix()
    return FramePose(np.array(origin.xyz or (0.0, 0.0, 0.0), dtype=float), turn)

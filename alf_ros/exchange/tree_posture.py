"""Positions of the joints of a URDF at which its loops close."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.exchange import loop_gaps, open_loops
from alf_ros.exchange.robot import STILL, FramePose
from alf_ros.exchange.two_ended_loops import TwoEndedLoop
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.exchange.urdf_motions import TreeMotion


@dataclass(frozen=True)
class TreeStep:
    """One motion of a tree: of a frame in the one before, which is at `pose` without the motion.

    motion: None if nothing moves. driver: number of the unknown that moves it, -1 for none;
    x = factor x_driver + offset.
    """

    child: str
    parent: str
    pose: FramePose
    motion: TreeMotion | None
    driver: int
    factor: float
    offset: float


class TreePosture:
    """Loops of a URDF that share joints, as a function of the positions of these joints.

    names: of the joints. size: m, of the robot.
    """

    def __init__(
        self,
        reader: UrdfReader,
        loops: Sequence[TwoEndedLoop],
        names: Sequence[str],
        size: float,
    ) -> None:
        self.names, self.size, self._loops = names, size, loops
        self._reader = reader
        self.loops = ', '.join(loop.name for loop in loops)
        self.drawn = np.array([reader.positions.get(name, 0.0) for name in names])
        self._place = {name: n for n, name in enumerate(names)}
        motions = [each for joint in reader.joints.values() for each in reader.motions(joint)]
        slides = {motion.name: motion.slides for motion in motions}
        self._slides = np.array([slides[name] for name in names], dtype=bool)
        self._chains: dict[str, list[TreeStep]] = {}
        steps: dict[str, list[TreeStep]] = {}
        for loop in loops:
            for end in loop.ends:
                chain: list[TreeStep] = []
                for joint in _chain(reader, end.link):
                    if joint.child not in steps:
                        steps[joint.child] = self._steps(joint)
                    chain += reversed(steps[joint.child])
                self._chains[end.link] = chain

    def _steps(self, joint: Any) -> list[TreeStep]:
        """The motions of a joint; the last one is of the child's frame."""
        reader, pose, above = self._reader, self._reader.pose_of(joint, {}), joint.parent
        motions = reader.motions(joint)
        if not motions:
            return [TreeStep(joint.child, above, pose, None, -1, 0.0, 0.0)]
        found = []
        for motion in motions:
            driver, factor = _driver(reader, motion.name)
            x = reader.positions.get(motion.name, 0.0)
            number = self._place.get(driver, -1)
            offset = x - factor * reader.positions.get(driver, 0.0) if number >= 0 else x
            child = joint.child if motion is motions[-1] else motion.name
            found.append(TreeStep(child, above, pose, motion, number, factor, offset))
            above, pose = child, STILL
        return found

    def limits(self) -> tuple[Floats, Floats]:
        """Lower and upper limit of each joint, rad or m. Limits of joints that mimic it count as
        well, unless they leave it no interval: such limits are listed."""
        low, high = np.full((2, len(self.names)), np.inf) * [[-1.0], [1.0]]
        for joint in sorted(self._reader.joints.values(), key=lambda j: j.name not in self._place):
            limited = joint.limit is not None and joint.type in ('revolute', 'prismatic')
            ends = (joint.limit.lower or 0.0, joint.limit.upper or 0.0) if limited else (0.0, 0.0)
            driver, factor = _driver(self._reader, joint.name)
            n = self._place.get(driver, -1)
            if not ends[0] < ends[1] or n < 0 or factor == 0.0:
                continue
            offset = self._reader.mimicked(joint.name, {driver: 0.0})
            lower, upper = sorted((end - offset) / factor for end in ends)
            lower, upper = max(low[n], lower), min(high[n], upper)
            if lower < upper:
                low[n], high[n] = lower, upper
            else:
                self._reader.robot.leave('limits of mimics', f'{joint.name} of {driver}')
        return low, high

    def scales(self) -> Floats:
        """rad, or the size of the robot, of each joint."""
        return np.where(self._slides, self.size, 1.0)

    def gaps(self, x: Floats) -> tuple[Floats, Floats]:
        """By how much the loops are open (rows,), m, and the derivative (rows, joints)."""
        poses = self._poses(x)
        found = []
        for loop in self._loops:
            ends = [poses[end.link] @ end.frame for end in loop.ends]
            slopes = [
                self._slopes(end.link, pose.origin, poses)
                for end, pose in zip(loop.ends, ends, strict=True)
            ]
            found.append(loop_gaps.gap(loop.kind, ends, slopes, self.size, loop.pitch))
        values, rows = zip(*found, strict=True)
        return np.concatenate(values), np.concatenate(rows)

    def _poses(self, x: Floats) -> dict[str, FramePose]:
        poses: dict[str, FramePose] = {}
        for link, chain in self._chains.items():
            poses.setdefault(chain[-1].parent if chain else link, STILL)
            for step in reversed(chain):
                if step.child not in poses:
                    poses[step.child] = poses[step.parent] @ _moved(step, x)
        return poses

    def _slopes(
        self, link: str, place: Floats, poses: dict[str, FramePose]
    ) -> tuple[Floats, Floats]:
        """(3, joints) derivatives of the rotation of a link, and of a place on it."""
        turn, slide = np.zeros((2, 3, len(self.names)))
        for step in self._chains[link]:
            if step.driver < 0 or step.motion is None:
                continue
            pose = poses[step.child]
            axis = step.factor * (pose.turn @ step.motion.axis)
            if step.motion.slides:
                slide[:, step.driver] += axis
            else:
                turn[:, step.driver] += axis
                slide[:, step.driver] += np.cross(axis, place - pose.origin)
        return turn, slide


def _moved(step: TreeStep, at: Floats) -> FramePose:
    """The pose of the child's frame in the parent's."""
    if step.motion is None:
        return step.pose
    value = step.offset + (step.factor * float(at[step.driver]) if step.driver >= 0 else 0.0)
    if step.motion.slides or value == 0.0:
        return step.motion.moved(step.pose, value)
    x, y, z = step.motion.axis.tolist()  # random starts differ by its rounding
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned = np.eye(3) + np.sin(value) * K + (1.0 - np.cos(value)) * (K @ K)
    return FramePose(step.pose.origin, step.pose.turn @ turned)


def _chain(reader: UrdfReader, link: str) -> list[Any]:
    """The joints from a link up to the root."""
    above = {joint.child: joint for joint in reader.joints.values()}
    chain = []
    while link in above:
        chain.append(above[link])
        link = chain[-1].parent
    return chain


def _driver(reader: UrdfReader, name: str) -> tuple[str, float]:
    """The joint that a joint mimics, along the chain, and the factor."""
    factor = 1.0
    while name in reader.mimics:
        name, own, _ = reader.mimics[name]
        factor *= own
    return name, factor


def closed_positions(
    reader: UrdfReader, loops: Sequence[TwoEndedLoop], held: Sequence[str]
) -> dict[str, float]:
    """Positions (rad, m) of the joints that must move to close the loops; none if all are closed.

    held: joints that stay. Raises InputError if no start leads to closed loops.
    """
    for loop in loops:
        for end in loop.ends:
            reader.part(end.link, loop.name)
    size = max(float(np.abs(pose.origin).max()) for pose in reader.poses.values()) or 1.0
    found: dict[str, float] = {}
    movable = ((loop, _movable(reader, loop, held)) for loop in loops)
    for own, free in open_loops.groups(movable):
        names = sorted(free)
        x = open_loops.closed(TreePosture(reader, own, names, size), reader.robot)
        if x is not None:
            found |= dict(zip(names, x.tolist(), strict=True))
    return found


def _movable(reader: UrdfReader, loop: TwoEndedLoop, held: Sequence[str]) -> set[str]:
    """The coordinates of joints that may move to close a loop: below where both ends meet."""
    first, second = (
        {motion.name for joint in _chain(reader, end.link) for motion in reader.motions(joint)}
        for end in loop.ends
    )
    drivers = {_driver(reader, name)[0] for name in first ^ second} - set(held)
    return {
        name for name in drivers if name in first | second or reader.motions(reader.joints[name])
    }

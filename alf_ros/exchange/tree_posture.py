"""Positions of the joints of a tree at which its loops close.

Loops that share joints are closed together. Newton's method moves their joints within the limits:
from the positions given first, then from random ones around them. Of the postures found, the one
nearest to the given positions holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import STILL, FramePose
from alf_ros.exchange.two_ended_loops import TwoEndedLoop
from alf_ros.exchange.urdf_import import UrdfReader

_AS_DRAWN, _CLOSED = 1e-6, 1e-10  # of the size: loops that are closed as drawn, and when found
_STARTS, _ROUNDS, _POLISH = 60, 60, 6
_MORE = 2  # times as many starts as the first posture took, to find nearer ones
_SPREAD = 0.3  # rad, or of the size: standard deviation of the first random start
_AXES = {'weld': (0, 1, 2), 'revolute': (2,)}  # of frames that coincide


@dataclass(frozen=True)
class TreeStep:
    """One joint of a tree: the pose of the child's frame with the joint at zero, the axis there.

    driver: number of the joint that moves it, -1 for none; x = factor x_driver + offset.
    """

    child: str
    parent: str
    pose: FramePose
    axis: Floats
    slides: bool
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
        self.names, self.size, self.loops = names, size, loops
        self._reader = reader
        place = {name: n for n, name in enumerate(names)}
        self._chains: dict[str, list[TreeStep]] = {}
        steps: dict[str, TreeStep] = {}
        for loop in loops:
            for end in loop.ends:
                chain = []
                for joint in _chain(reader, end.link):
                    if joint.child not in steps:
                        steps[joint.child] = self._step(joint, place)
                    chain.append(steps[joint.child])
                self._chains[end.link] = chain

    def _step(self, joint: Any, place: dict[str, int]) -> TreeStep:
        reader, name = self._reader, joint.name
        pose, moves = reader.pose_of(joint, {}), _moves(joint)
        driver, factor = _driver(reader, name)
        x = reader.positions.get(name, 0.0) if moves else 0.0
        number = place.get(driver, -1) if moves else -1
        offset = x - factor * reader.positions.get(driver, 0.0) if number >= 0 else x
        axis = reader.unit(name, joint.axis) if moves else np.zeros(3)
        slides = joint.type == 'prismatic'
        return TreeStep(joint.child, joint.parent, pose, axis, slides, number, factor, offset)

    def limits(self) -> tuple[Floats, Floats]:
        """Lower and upper limit of each joint, rad or m."""
        low, high = np.full((2, len(self.names)), np.inf) * [[-1.0], [1.0]]
        for n, name in enumerate(self.names):
            joint = self._reader.joints[name]
            limit = joint.limit if joint.type in ('revolute', 'prismatic') else None
            if limit is not None and (limit.lower or 0.0) < (limit.upper or 0.0):
                low[n], high[n] = limit.lower or 0.0, limit.upper or 0.0
        return low, high

    def scales(self) -> Floats:
        """rad, or the size of the robot, of each joint."""
        kinds = [self._reader.joints[name].type for name in self.names]
        return np.array([self.size if kind == 'prismatic' else 1.0 for kind in kinds])

    def gaps(self, x: Floats) -> tuple[Floats, Floats]:
        """By how much the loops are open (rows,), m, and the derivative (rows, joints)."""
        poses = self._poses(x)
        values, slopes = list[Floats](), list[Floats]()
        for loop in self.loops:
            ends = [poses[end.link] @ end.frame for end in loop.ends]
            (turn0, slide0), (turn1, slide1) = (
                self._slopes(end.link, pose.origin, poses)
                for end, pose in zip(loop.ends, ends, strict=True)
            )
            values.append(ends[0].origin - ends[1].origin)
            slopes.append(slide0 - slide1)
            for k in _AXES.get(loop.kind, ()):
                a, b = (end.turn[:, k] for end in ends)
                da, db = np.cross(turn0.T, a), np.cross(turn1.T, b)
                if loop.kind == 'weld':
                    values.append(self.size * (a - b))
                    slopes.append(self.size * (da - db).T)
                else:  # a hinge has no direction
                    values.append(np.asarray(self.size * np.cross(a, b), dtype=float))
                    slopes.append(self.size * np.asarray(np.cross(da, b) + np.cross(a, db)).T)
        return np.concatenate(values), np.concatenate(slopes)

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
            if step.driver < 0:
                continue
            pose = poses[step.child]
            axis = step.factor * (pose.turn @ step.axis)
            if step.slides:
                slide[:, step.driver] += axis
            else:
                turn[:, step.driver] += axis
                slide[:, step.driver] += np.cross(axis, place - pose.origin)
        return turn, slide


def _moved(step: TreeStep, at: Floats) -> FramePose:
    """The pose of the child's frame in the parent's."""
    value = step.offset + (step.factor * float(at[step.driver]) if step.driver >= 0 else 0.0)
    if value == 0.0:
        return step.pose
    if step.slides:
        return FramePose(step.pose.place(value * step.axis), step.pose.turn)
    x, y, z = step.axis.tolist()
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned = np.eye(3) + np.sin(value) * K + (1.0 - np.cos(value)) * (K @ K)
    return FramePose(step.pose.origin, step.pose.turn @ turned)


def _moves(joint: Any) -> bool:
    return joint.type in ('revolute', 'continuous', 'prismatic')


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


def _groups(
    reader: UrdfReader, loops: Sequence[TwoEndedLoop], held: Sequence[str]
) -> Iterator[tuple[list[TwoEndedLoop], list[str]]]:
    """Loops that share joints, and these joints: below where both ends of a loop meet."""
    groups: list[tuple[list[TwoEndedLoop], set[str]]] = []
    for loop in loops:
        first, second = (
            {joint.name for joint in _chain(reader, end.link) if _moves(joint)}
            for end in loop.ends
        )
        names = {_driver(reader, name)[0] for name in first ^ second} - set(held)
        together = [group for group in groups if group[1] & names]
        groups = [group for group in groups if not group[1] & names]
        joined = [each for group in together for each in group[0]]
        groups.append(([*joined, loop], names.union(*(group[1] for group in together))))
    for own, names in groups:
        yield own, sorted(name for name in names if _moves(reader.joints[name]))


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
    for own, names in _groups(reader, loops, held):
        tree = TreePosture(reader, own, names, size)
        x = _posture(tree, reader)
        if x is not None:
            found |= dict(zip(names, x.tolist(), strict=True))
    return found


def _posture(tree: TreePosture, reader: UrdfReader) -> Floats | None:
    """(joints,) rad or m, where a group of loops is closed; None if it is closed as drawn."""
    low, high = tree.limits()
    drawn = np.array([reader.positions.get(name, 0.0) for name in tree.names])
    if np.abs(tree.gaps(drawn)[0]).max() <= _AS_DRAWN * tree.size:
        return None
    begin = np.clip(drawn, low, high)
    scales, random = tree.scales(), np.random.default_rng(0)
    found: list[tuple[float, int, Floats]] = []
    least, starts = np.inf, 0
    while starts < _STARTS and not (found and starts > _MORE * found[0][1]):
        spread = _SPREAD * min(1.0, 0.1 * starts) * (1.0 + starts / 15.0)
        x = begin + spread * scales * random.standard_normal(begin.size)
        x, gap = _settled(tree, np.clip(x, low, high), low, high)
        least = min(least, gap)
        if gap <= _CLOSED * tree.size:
            away = float(np.abs((x - begin) / scales).max(initial=0.0))
            found.append((away, starts, x))
        starts += 1
    names = ', '.join(loop.name for loop in tree.loops)
    if not found:
        raise reader.error(
            'loops',
            f'{names} cannot be closed: {least:.3g} m stay open, from {starts} starts',
            expected='positions near a posture, by --set JOINT=NUMBER',
        )
    count = f'{len(found)} of {starts} starts close them'
    reader.robot.leave('posture', f'{names} ({count}; the nearest posture is taken)')
    return min(found, key=lambda each: each[:2])[2]


def _settled(tree: TreePosture, x: Floats, low: Floats, high: Floats) -> tuple[Floats, float]:
    """Where Newton's method leads from x within limits, and the largest gap there, m."""
    if not x.size:
        return x, float(np.abs(tree.gaps(x)[0]).max())
    inside = np.nextafter(low, high), np.nextafter(high, low)
    with np.errstate(all='ignore'):  # where it has arrived, scipy divides zero by zero
        solved = least_squares(
            lambda y: tree.gaps(y)[0],
            np.clip(x, *inside),
            lambda y: tree.gaps(y)[1],
            bounds=(low, high),
            x_scale=tree.scales(),
            xtol=1e-8,
            ftol=1e-8,
            gtol=None,
            max_nfev=_ROUNDS,
        )
    x = np.asarray(solved.x)
    best = float(np.abs(tree.gaps(x)[0]).max())
    for _ in range(_POLISH):
        value, slope = tree.gaps(x)
        step, *_ = np.linalg.lstsq(slope, -value, rcond=1e-10)
        y = np.clip(x + step, low, high)
        gap = float(np.abs(tree.gaps(y)[0]).max())
        if not gap < best:
            break
        x, best = y, gap
    return x, best

"""Poses of bodies at which the joints of a USD stage are closed.

The file places each body, so its joints may be drawn apart. Newton's method then moves the bodies:
each step is the least motion (ω and v of each body) that closes all joints to first order. For the
frames A_0, A_1 of a joint at p_0, p_1 the gap is d = A_0ᵀ (p_1 - p_0) in its locked directions,
and a_0 · a_1 of the axes that stay perpendicular.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import GROUND, STILL, FramePose, Robot
from alf_ros.exchange.usd_joints import UsdJoint

_AS_DRAWN, _CLOSED = 1e-6, 1e-12  # of the size: joints that are closed as drawn, and when found
_ROUNDS = 60
_MOST = 0.3  # rad, or of the size: the longest step
_RANK = 1e-9  # of the largest singular value: loops repeat what others hold
_BODIES = 300  # that joints connect and that are moved together, by dense matrices


def motions(
    robot: Robot, joints: Sequence[UsdJoint], places: Mapping[str, Floats]
) -> dict[str, FramePose]:
    """The motion of each body, in the world, that closes all joints; the ground has one too.

    places: (3,) m, of the bodies. Raises InputError if joints stay open.
    """
    ends = [end.frame.origin for each in joints for end in each.ends]
    size = float(np.ptp([*ends, *places.values(), np.zeros(3)], axis=0).max()) or 1.0
    whole = dict.fromkeys((*places, GROUND), STILL)
    apart = [each for each in joints if _is_open(each, whole, size)]
    for joint in apart:
        if _opposite(joint, whole):
            raise robot.error(joint.name, 'its two ends are drawn more than a right angle apart')
    if not apart:
        return whole
    found = _Posture(_connected(joints, apart), places, size)
    if len(found.number) > _BODIES:
        expected = f'bodies where the joints meet: at most {_BODIES} together are moved there'
        raise robot.error(apart[0].name, 'its two ends are drawn apart', expected=expected)
    found.close()
    whole |= found.motion
    still_open = [each for each in joints if _is_open(each, whole, size)]
    if still_open:
        gap = max(float(np.abs(_values(each, whole, size)).max()) for each in still_open)
        raise robot.error(
            apart[0].name,
            f'drawn apart, and moving the bodies leaves a gap of {gap:.3g} m',
            expected='bodies placed where the joints meet',
        )
    far = max(float(np.linalg.norm(whole[name].place(at) - at)) for name, at in places.items())
    names = ', '.join(each.name for each in apart)
    robot.leave('posture of bodies', f'{names} (by {far:.3g} m at most)')
    return whole


def _connected(joints: Sequence[UsdJoint], apart: Sequence[UsdJoint]) -> list[UsdJoint]:
    """The joints that bodies connect with open ones; the ground connects nothing."""
    found = {end.body for each in apart for end in each.ends} - {GROUND}
    while True:
        more = {
            end.body
            for each in joints
            if not found.isdisjoint(end.body for end in each.ends)
            for end in each.ends
        } - {GROUND}
        if more <= found:
            return [each for each in joints if any(end.body in found for end in each.ends)]
        found |= more


def _frames(joint: UsdJoint, motion: Mapping[str, FramePose]) -> tuple[FramePose, FramePose]:
    first, second = (motion.get(end.body, STILL) @ end.frame for end in joint.ends)
    return first, second


def _values(joint: UsdJoint, motion: Mapping[str, FramePose], size: float) -> Floats:
    """(rows,) m, by how much a joint is open."""
    first, second = _frames(joint, motion)
    apart = first.turn.T @ (second.origin - first.origin)
    between = first.turn.T @ second.turn
    turned = [size * between[pair] for pair in joint.perpendicular]
    return np.array([*(apart[n] for n in joint.slides_locked), *turned])


def _opposite(joint: UsdJoint, motion: Mapping[str, FramePose]) -> bool:
    """Whether axes that should coincide point in opposite directions."""
    first, second = _frames(joint, motion)
    return any(first.turn[:, n] @ second.turn[:, n] < 0.0 for n in joint.same)


def _is_open(joint: UsdJoint, motion: Mapping[str, FramePose], size: float) -> bool:
    gap = np.abs(_values(joint, motion, size)).max(initial=0.0)
    return bool(gap > _AS_DRAWN * size) or _opposite(joint, motion)


class _Posture:
    """Joints, as a function of the motions of the bodies."""

    def __init__(
        self, joints: Sequence[UsdJoint], places: Mapping[str, Floats], size: float
    ) -> None:
        self.joints, self.places, self.size = joints, places, size
        held = {end.body for each in joints for end in each.ends} - {GROUND}
        self.number = {body: n for n, body in enumerate(sorted(held))}
        self.motion = dict.fromkeys(self.number, STILL)

    def moved(self, body: str, place: Floats) -> Floats:
        return self.motion.get(body, STILL).place(place)

    def gaps(self) -> Floats:
        """(rows,) m, by how much the joints are open."""
        return np.concatenate([_values(each, self.motion, self.size) for each in self.joints])

    def slopes(self) -> Floats:
        """(rows, 6 bodies) the derivative of the gaps by turns of each body about its origin,
        times the size, and by its velocity."""
        slopes = []
        for joint in self.joints:
            first, second = _frames(joint, self.motion)
            apart = second.origin - first.origin
            for n in joint.slides_locked:
                axis = first.turn[:, n]
                row = self._row(joint, (first.origin, second.origin), axis)
                self._turn(row, joint.ends[0].body, np.cross(axis, apart))
                slopes.append(row)
            for n, m in joint.perpendicular:
                across = self.size * np.cross(first.turn[:, n], second.turn[:, m])
                row = np.zeros(6 * len(self.number))
                self._turn(row, joint.ends[0].body, across)
                self._turn(row, joint.ends[1].body, -across)
                slopes.append(row)
        return np.array(slopes)

    def close(self) -> None:
        """Move the bodies until the joints are closed, or no step helps."""
        for _ in range(_ROUNDS):
            values = self.gaps()
            if np.abs(values).max() <= _CLOSED * self.size:
                return
            step, *_ = np.linalg.lstsq(self.slopes(), -values, rcond=_RANK)
            step *= min(1.0, _MOST * self.size / max(float(np.abs(step).max()), 1e-300))
            for body, n in self.number.items():
                turn, slide = step[6 * n : 6 * n + 3] / self.size, step[6 * n + 3 : 6 * n + 6]
                at = self.moved(body, self.places[body])
                turned = Rotation.from_rotvec(turn).as_matrix()
                move = FramePose(at + slide - turned @ at, turned)
                self.motion[body] = move @ self.motion[body]

    def _row(self, joint: UsdJoint, ends: tuple[Floats, Floats], axis: Floats) -> Floats:
        """The derivative of axis · (p_1 - p_0) by the motions of the bodies."""
        row = np.zeros(6 * len(self.number))
        for end, place, sign in zip(joint.ends, ends, (-1.0, 1.0), strict=True):
            n = self.number.get(end.body)
            if n is not None:
                arm = place - self.moved(end.body, self.places[end.body])
                row[6 * n + 3 : 6 * n + 6] += sign * axis
                self._turn(row, end.body, sign * np.cross(arm, axis))
        return row

    def _turn(self, row: Floats, body: str, slope: NDArray[np.floating[Any]]) -> None:
        """Add a derivative by the turn of a body, of which the unknown is turn times size."""
        n = self.number.get(body)
        if n is not None:
            row[6 * n : 6 * n + 3] += slope / self.size

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
from alf_ros.exchange.robot import STILL, FramePose, Robot
from alf_ros.exchange.usd_joints import UsdJoint
from alf_ros.mechanism import GROUND

_AS_DRAWN, _CLOSED = 1e-6, 1e-12  # of the size: joints that are closed as drawn, and when found
_ROUNDS = 60
_MOST = 0.3  # rad, or of the size: the longest step
_RANK = 1e-9  # of the largest singular value: loops repeat what others hold


def motions(
    robot: Robot, joints: Sequence[UsdJoint], places: Mapping[str, Floats]
) -> dict[str, FramePose]:
    """The motion of each body, in the world, that closes all joints; the ground has one too.

    places: (3,) m, of the bodies. Raises InputError if joints stay open.
    """
    found = _Posture(joints, places)
    still = dict.fromkeys((*places, GROUND), STILL)
    if not found.joints:
        return still
    values, _ = found.gaps()
    if np.abs(values).max(initial=0.0) <= _AS_DRAWN * found.size and not found.opposite():
        return still
    apart = found.open_joints()
    found.close()
    values, _ = found.gaps()
    if np.abs(values).max() > _AS_DRAWN * found.size or found.opposite():
        raise robot.error(
            apart[0],
            f'drawn {np.abs(values).max():.3g} m apart, and moving the bodies does not close it',
            expected='bodies placed where the joints meet',
        )
    far = max(float(np.linalg.norm(found.moved(name, at) - at)) for name, at in places.items())
    robot.leave('posture of bodies', f'{", ".join(apart)} (by {far:.3g} m at most)')
    return {name: found.motion.get(name, STILL) for name in still}


class _Posture:
    """The joints, as a function of the motions of the bodies."""

    def __init__(self, joints: Sequence[UsdJoint], places: Mapping[str, Floats]) -> None:
        self.joints, self.places = [each for each in joints if each.kind != 'distance'], places
        ends = [end.frame.origin for each in joints for end in each.ends]
        corners = np.array([*ends, *places.values(), np.zeros(3)])
        self.size = float(np.ptp(corners, axis=0).max()) or 1.0
        held = {end.body for each in self.joints for end in each.ends} - {GROUND}
        self.number = {body: n for n, body in enumerate(sorted(held))}
        self.motion = dict.fromkeys(self.number, STILL)

    def moved(self, body: str, place: Floats) -> Floats:
        return self.motion.get(body, STILL).place(place)

    def gaps(self, only: UsdJoint | None = None) -> tuple[Floats, Floats]:
        """By how much joints are open (rows,), m, and its derivative (rows, 6 bodies): by turns of
        each body about its origin, times the size, and by its velocity."""
        values, slopes = [], []
        for joint in self.joints if only is None else (only,):
            first, second = (self.motion.get(e.body, STILL) @ e.frame for e in joint.ends)
            apart = second.origin - first.origin
            for n in joint.slides_locked:
                axis = first.turn[:, n]
                row = self._row(joint, (first.origin, second.origin), axis)
                self._turn(row, joint.ends[0].body, np.cross(axis, apart))
                values.append(axis @ apart)
                slopes.append(row)
            for n, m in joint.perpendicular:
                a, b = first.turn[:, n], second.turn[:, m]
                row = np.zeros(6 * len(self.number))
                self._turn(row, joint.ends[0].body, self.size * np.cross(a, b))
                self._turn(row, joint.ends[1].body, -self.size * np.cross(a, b))
                values.append(self.size * (a @ b))
                slopes.append(row)
        width = 6 * len(self.number)
        return np.array(values), np.array(slopes).reshape(-1, width)

    def opposite(self) -> list[str]:
        """Joints of which axes that should coincide point in opposite directions."""
        found = []
        for joint in self.joints:
            first, second = (self.motion.get(e.body, STILL) @ e.frame for e in joint.ends)
            if any(first.turn[:, n] @ second.turn[:, n] < 0.0 for n in joint.same):
                found.append(joint.name)
        return found

    def open_joints(self) -> list[str]:
        """Names of the joints that are not closed."""
        turned = self.opposite()
        return [
            each.name
            for each in self.joints
            if each.name in turned
            or np.abs(self.gaps(each)[0]).max(initial=0.0) > _AS_DRAWN * self.size
        ]

    def close(self) -> None:
        """Move the bodies until the joints are closed, or no step helps."""
        for _ in range(_ROUNDS):
            values, slopes = self.gaps()
            if np.abs(values).max() <= _CLOSED * self.size:
                return
            step, *_ = np.linalg.lstsq(slopes, -values, rcond=_RANK)
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

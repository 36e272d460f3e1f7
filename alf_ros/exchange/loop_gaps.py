"""By how much a loop is open: a joint between two frames, of which z is the axis of the joint.

For the frames A_0, A_1 at p_0, p_1, with d = p_0 - p_1 and their axes x, y, z:

    weld         d, and A_0 - A_1             spherical    d
    revolute     d, and z_0 × z_1             universal    d, and z_0 · z_1
    cylindrical  x_0 · d, y_0 · d, z_0 × z_1  planar       z_0 · d, and z_0 × z_1
    prismatic    x_0 · d, y_0 · d, A_0 - A_1
    screw        x_0 · d, y_0 · d, R A_0 - A_1

R turns about z_0 by as much as the thread does from p_0 to p_1: any number of whole turns is the
same thread. Numbers without unit are multiplied by the size of the robot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import FramePose

# of the first frame: the directions in which the places coincide; None: in all
_HELD = {'cylindrical': (0, 1), 'prismatic': (0, 1), 'screw': (0, 1), 'planar': (2,)}
_SAME = ('weld', 'prismatic', 'screw')  # all axes coincide
_PARALLEL = ('revolute', 'cylindrical', 'planar')  # z axes, in either direction: a hinge has none

Slope = tuple[Floats, Floats]  # (3, n) of the rotation, and of the origin of a frame


def slides(kind: str) -> bool:
    """Whether the places of both frames move apart."""
    return kind in _HELD


def gap(
    kind: str,
    ends: Sequence[FramePose],
    slopes: Sequence[Slope],
    size: float,
    pitch: float = 0.0,
) -> tuple[Floats, Floats]:
    """Values (rows,) m of a loop, and the derivative (rows, n) by n unknowns.

    slopes: how each frame turns (rad) and moves (m) with the unknowns. size: of the robot, m.
    pitch: of a screw, m per turn.
    """
    first, second = ends
    (turn0, slide0), (turn1, slide1) = slopes
    d, dd = first.origin - second.origin, slide0 - slide1
    values, rows = [], []
    if kind in _HELD:
        for k in _HELD[kind]:
            axis = first.turn[:, k]
            values.append(np.array([axis @ d]))
            rows.append((axis @ dd + np.cross(turn0.T, axis) @ d)[None])
    else:
        values.append(d)
        rows.append(dd)
    if kind == 'screw':
        z, lead = first.turn[:, 2], pitch / (2.0 * np.pi)
        first = FramePose(first.origin, _turned(z, -float(z @ d) / lead) @ first.turn)
        turn0 = turn0 - np.outer(z, z @ dd + np.cross(turn0.T, z) @ d) / lead
    for k in range(3) if kind in _SAME else ():
        a, b = first.turn[:, k], second.turn[:, k]
        values.append(size * (a - b))
        rows.append(size * (np.cross(turn0.T, a) - np.cross(turn1.T, b)).T)
    if kind in _PARALLEL or kind == 'universal':
        a, b = first.turn[:, 2], second.turn[:, 2]
        da, db = np.cross(turn0.T, a), np.cross(turn1.T, b)
        if kind == 'universal':
            values.append(np.array([size * (a @ b)]))
            rows.append(size * (da @ b + db @ a)[None])
        else:
            values.append(np.asarray(size * np.cross(a, b), dtype=float))
            rows.append(size * np.asarray(np.cross(da, b) + np.cross(a, db)).T)
    return np.concatenate(values), np.concatenate(rows)


def _turned(axis: Floats, angle: float) -> Floats:
    """(3, 3) the rotation about a unit axis by an angle, rad."""
    return np.asarray(Rotation.from_rotvec(angle * axis).as_matrix())

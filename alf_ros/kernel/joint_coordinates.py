"""Angles that are counted, and joint coordinates, with their rates."""

from __future__ import annotations

import math

import numpy as np

from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.kernel.constraints import value_and_rate
from alf_ros.kernel.data import JointCoordinates, Rows
from alf_ros.kernel.numba_ext.jit import ONE, TWO, compiled
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import vector
from alf_ros.kernel.unwrapping import to_a_quarter


@compiled
def counted_angles(
    unit: Unit,
    rows: Rows,
    q: Floats,
    qd: Floats,
    turns: Integers,
    angles: Floats,
    spins: Floats,
    near: Floats,
) -> None:
    """Of each pair of rows x, y: the angle with its turns (rad), its rate (rad/s), and the angle
    to a quarter turn."""
    q, qd, turns = vector(q), vector(qd), vector(turns)
    for n in each(0, turns.size):
        x, xd = value_and_rate(unit, rows, TWO * n, q, qd)
        y, yd = value_and_rate(unit, rows, TWO * n + ONE, q, qd)
        # adding zero makes -0.0 positive, so that atan2 agrees with the count of turns
        angles[n] = math.atan2(y + 0.0, x) + 2.0 * np.pi * turns[n]
        spins[n] = (x * yd - y * xd) / (x * x + y * y)
        near[n] = to_a_quarter(y, turns[n])


@compiled
def joint_coordinates(
    unit: Unit,
    joints: JointCoordinates,
    q: Floats,
    qd: Floats,
    angles: Floats,
    spins: Floats,
    values: Floats,
    rates: Floats,
) -> None:
    """Joint coordinates (rad, m) and their rates, from the angles that are counted."""
    q, qd, angles, spins = vector(q), vector(qd), vector(angles), vector(spins)
    for n in each(0, joints.place.size):
        place, less = np.uint64(joints.place[n]), joints.less[n]
        if place < angles.size:
            x, xd = angles[place], spins[place]
        else:
            x, xd = value_and_rate(unit, joints.lengths, place - angles.size, q, qd)
        if less >= 0:
            x -= angles[less]
            xd -= spins[less]
        values[n], rates[n] = x, xd

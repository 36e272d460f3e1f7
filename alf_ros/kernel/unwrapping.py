"""Counted angles: x, y of each, with angle = atan2(y, x), and its turns."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.kernel.constraints import form
from alf_ros.kernel.data import Rows
from alf_ros.kernel.numba_ext.jit import ONE, TWO, compiled, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, pick, unless
from alf_ros.kernel.numba_ext.plain_loops import each


@inner
def count_turns(before: Floats, after: Floats, turns: Integers) -> None:
    """Count the passages of each (x, y) over the negative x axis."""
    for n in range(turns.size):
        x0, y0, x1, y1 = before[2 * n], before[2 * n + 1], after[2 * n], after[2 * n + 1]
        crossed = (y0 < 0.0) ^ (y1 < 0.0)
        if anywhere(crossed):
            counter_clockwise = x0 * y1 - x1 * y0 > 0.0
            turns[n] += pick(crossed & counter_clockwise & (y1 < 0.0), 1, 0)
            turns[n] -= pick(crossed & unless(counter_clockwise) & (y0 < 0.0), 1, 0)


@inner
def some_crossed(unit: Unit, angles: Rows, q: Floats, before: Floats) -> bool:
    """Whether at q some (x, y) is on the other side of the x axis than `before`."""
    for n in each(0, before.size // TWO):
        y = TWO * n + ONE
        if (form(unit, angles, y, q) < 0.0) != (before[y] < 0.0):
            return True
    return False


@inlined
def to_a_quarter(y: float, turns: np.int64) -> float:
    """An angle with its turns (rad), to a quarter turn, from the y of it.

    This is accurate enough to unwrap the angles of the stages of a step, and needs no arcus
    tangent.
    """
    return 2.0 * np.pi * turns + pick(y < 0.0, -0.5 * np.pi, 0.5 * np.pi)


@compiled
def nearby(xy: Floats, turns: Integers, near: Floats) -> None:
    """Each angle with its turns (rad), to a quarter turn."""
    for n in range(turns.size):
        near[n] = to_a_quarter(xy[2 * n + 1], turns[n])

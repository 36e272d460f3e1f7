"""The integral of a row that binds velocities: a sum of angles and lengths that stays constant.

Gears, racks, threads, wheels on a line of the plane and couplings have rows of velocities, because
a row of second order has the sine and cosine of an angle, and not the angle with its turns. Such
a row is the derivative of a sum, Σ a_n x_n, of angles that are counted and of lengths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism.affine import Form
from alf_ros.model.constraints.row import Row, linear, product, value


class IntegralTerm(NamedTuple):
    """One term of the sum: `factor` times an angle (m/rad) or a length (1, or m/m).

    rows: the rows x and y of the angle atan2(y, x), or the one row of the length.
    """

    factor: float
    rows: tuple[Row, ...]

    @property
    def is_angle(self) -> bool:
        """Whether its turns must be counted."""
        return len(self.rows) > 1


def planar_angle(factor: float, d: Form) -> IntegralTerm:
    """The angle of a direction in the plane."""
    x, y = (linear('', along, d) for along in np.eye(2))
    return IntegralTerm(factor, (x, y))


def angle_between(factor: float, X: Form, Y: Form, d: Form) -> IntegralTerm:
    """The angle of d in axes X, Y of unit length."""
    return IntegralTerm(factor, (product('', X, d), product('', Y, d)))


def slip_of(terms: Sequence[IntegralTerm], before: Floats, after: Floats) -> float:
    """m, by how much the sum changes from q to q (blocks, D); an angle by half a turn at most."""
    return sum(term.factor * _change(term.rows, before, after) for term in terms)


def _change(rows: tuple[Row, ...], before: Floats, after: Floats) -> float:
    if len(rows) == 1:
        return value(rows[0], after) - value(rows[0], before)
    (x0, y0), (x1, y1) = ([value(row, q) for row in rows] for q in (before, after))
    return math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)

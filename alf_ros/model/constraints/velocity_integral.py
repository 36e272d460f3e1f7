"""The integral of a row that binds velocities: a sum of angles and lengths that stays constant.

Gears, racks, threads, wheels on a line of the plane and couplings have rows of velocities, because
a row of second order has the sine and cosine of an angle, and not the angle with its turns. Such
a row is the derivative of a sum, Σ a_n x_n, of angles that are counted and of lengths.

Where the bodies are rigid the row is the gradient of the sum in all directions, also in those in
which bodies deform. Else a correction with the row and the Φ of the sum is no Newton step: rows
that depend on others would make rounding grow from step to step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism.affine import Form
from alf_ros.model.constraints.row import Row, linear, plus, product, scaled, value

Axes = tuple[Form, Form]  # x and y of a body, perpendicular, of unit length


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


def angle_between(factor: float, parent: Axes, child: Axes) -> IntegralTerm:
    """The angle by which the child's axes x, y are turned in the parent's X, Y, of one plane.

    If X and Y move it is the angle of a sum: of x in X, Y and of y in Y, -X. The gradient of the
    angle of x alone is no row: its part of the parent is of more than second order.
    """
    (X, Y), (x, y) = parent, child
    cosine, sine = product('', X, x), product('', Y, x)
    if _moves(parent):
        cosine = plus('', cosine, product('', Y, y))
        sine = plus('', sine, scaled(-1.0, product('', X, y)))
    return IntegralTerm(factor, (cosine, sine))


def rate_between(factor: float, parent: Axes, child: Axes) -> list[tuple[Form, Form]]:
    """Pairs of forms whose Σ f · ġ is the rate of `angle_between`: its gradient."""
    (X, Y), (x, y) = parent, child
    if not _moves(parent):
        return [(y.times(factor), x)]
    half = 0.5 * factor
    turned = [(y.times(half), x), (x.times(-half), y)]
    return [*turned, (Y.times(-half), X), (X.times(half), Y)]


def _moves(axes: Axes) -> bool:
    return any(axis.parts for axis in axes)


def slip_of(terms: Sequence[IntegralTerm], before: Floats, after: Floats) -> float:
    """m, by how much the sum changes from q to q (blocks, D); an angle by half a turn at most."""
    return sum(term.factor * _change(term.rows, before, after) for term in terms)


def _change(rows: tuple[Row, ...], before: Floats, after: Floats) -> float:
    if len(rows) == 1:
        return value(rows[0], after) - value(rows[0], before)
    (x0, y0), (x1, y1) = ([value(row, q) for row in rows] for q in (before, after))
    return math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)

"""Functions given by points or curves, packed for effects: piecewise polynomials.

Through points they are linear, or cubic (C², natural ends).
params: [pieces, x of the points …, (x₀, c₀ … c₅, ∫) per piece]: in a piece f = Σ c_i (x - x₀)^i,
and ∫ is the integral of f from the first point to x₀.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.effects.contract.scalars import shared
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.kernel.numba_ext.branch_notes import note_branch, plain_value
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.splines import cubic_spline

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Points = Sequence[Sequence[float]]
_GAPS = 4.0  # less than 1.4 of them are between two stages of each method, and two are a bump
_SHARP = 1e-6  # of the range of a spline
_CURVED = -0.618  # no slope that tables have


def pieces(points: Points, column: int = 1, cubic: bool = False, hold: bool = False) -> Floats:
    """A function through (x, f), f in `column`; beyond the ends straight on, or held.

    Raises ValueError unless x ascends and there are two points (one, if held).
    """
    x = np.array([point[0] for point in points])
    f = np.array([point[column] for point in points])
    if np.any(np.diff(x) <= 0.0):
        raise ValueError('the first column of a table must ascend')
    if x.size < (1 if hold else 2):
        raise ValueError('a table needs two points at least')
    c = np.zeros((x.size - 1, 4))
    if x.size > 1:
        c[:, 0], c[:, 1] = f[:-1], np.diff(f) / np.diff(x)
    if cubic and x.size > 2:
        c = cubic_spline(x, f, 'natural').c[::-1].T
    slopes = [0.0, 0.0]
    if not hold:
        h = x[-1] - x[-2]
        slopes = [c[0, 1], c[-1, 1] + h * (2.0 * c[-1, 2] + 3.0 * h * c[-1, 3])]
    h = np.diff(x)
    areas = h * (c[:, 0] + h * (c[:, 1] / 2.0 + h * (c[:, 2] / 3.0 + h * c[:, 3] / 4.0)))
    sums = np.concatenate([[0.0], np.cumsum(areas)])
    inner = np.column_stack([x[:-1], c, np.zeros((x.size - 1, 2)), sums[:-1]])
    first = [x[0], f[0], slopes[0], 0.0, 0.0, 0.0, 0.0, 0.0]
    last = [x[-1], f[-1], slopes[1], 0.0, 0.0, 0.0, 0.0, sums[-1]]
    return np.concatenate([[x.size], x, first, inner.ravel(), last])


def law(factor: float | None, points: Points | None) -> Floats:
    """f = factor x, in one piece, or piecewise linear through points (x, f). Raises ValueError."""
    if points is None:
        return np.array([0.0, 0.0, 0.0, factor or 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    if len(points[0]) != 2:
        raise ValueError('this table has two columns')
    return pieces(points)


def signal(value: float | Points | Curve) -> Floats:
    """A function of time: a number, a curve, or points (t, f), linear between, held beyond.

    The integral of a curve is nobody's business: it is not there.
    """
    if isinstance(value, Curve):
        inner = np.column_stack([value.pieces, np.zeros(len(value.pieces))])
        first = [*inner[0, :2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        return np.concatenate([[len(inner)], inner[:, 0], first, inner.ravel()])
    points = [(0.0, value)] if isinstance(value, (int, float)) else value
    if len(points[0]) != 2:
        raise ValueError('a table of a function of time has two columns')
    return pieces(points, hold=True)


def instants(*functions: float | Points | Curve, cubic: bool = False) -> Floats:
    """The times (s) of the kinks of functions of time, as `signal` or `pieces` takes them; of a
    spline those that `spline_instants` says."""
    return np.concatenate([np.zeros(0), *(_instants(each, cubic) for each in functions)])


def _instants(function: float | Points | Curve, cubic: bool) -> Floats:
    if isinstance(function, (int, float)):
        return np.zeros(0)
    if isinstance(function, Curve):
        return np.array([piece[0] for piece in function.pieces])
    table = np.array(function, dtype=float)
    x, f = table[:, 0], table[:, 1:]
    if cubic and x.size > 2:
        found = [spline_instants(cubic_spline(x, g, 'natural')) for g in f.T]
        return np.concatenate(found)
    level = np.zeros((1, f.shape[1]))
    slopes = np.vstack([level, np.diff(f, axis=0) / np.diff(x)[:, None], level])
    return np.asarray(x[(np.diff(slopes, axis=0) != 0.0).any(axis=1)])


def spline_instants(spline: CubicSpline) -> Floats:
    """The knots of a spline at which a step ends: those where its third derivative jumps by much,
    and so many that a few stages see what it does between two of them: no part is longer than four
    times the shortest distance of two knots in it."""
    x, gaps = spline.x, np.diff(spline.x)
    jumps = np.abs(np.diff(spline.c[0])) * np.minimum(gaps[:-1], gaps[1:]) ** 3
    sharp = jumps > _SHARP * np.ptp(spline(x))
    found, shortest = [x[0]], math.inf
    for k in range(1, x.size):
        shortest = min(shortest, gaps[k - 1])
        if k > 1 and (sharp[k - 2] or x[k] - found[-1] > _GAPS * shortest):
            if x[k - 1] > found[-1]:
                found.append(x[k - 1])
            shortest = gaps[k - 1]
    return np.array([*found, x[-1]])


@shared
def _piece(params: Floats, at: int, x: float) -> int:
    points, value = int(params[at]), plain_value(x)
    low, high = 0, points  # number of points that are not beyond x
    while low < high:
        middle = (low + high) // 2
        if params[at + 1 + middle] <= value:
            low = middle + 1
        else:
            high = middle
    p = at + 1 + points + 8 * low
    note_branch(x, -1 if _is_curved(params, p) else low)
    return p


@shared
def _is_curved(params: Floats, p: int) -> bool:
    """Whether a piece is one of a spline, which has no kinks."""
    for i in range(3, 7):
        if params[p + i] != 0.0:
            return True
    return False


@shared
def interpolate(params: Floats, at: int, x: float) -> float:
    """f(x) of the table at params[at]."""
    if params[at] == 0.0:  # no points: a straight `law`, from 0
        return plus_product(params[at + 2], params[at + 3], x)
    p = _piece(params, at, x)
    d = x - params[p]
    upper = plus_product(params[p + 5], params[p + 6], d)
    upper = plus_product(params[p + 4], upper, d)
    upper = plus_product(params[p + 3], upper, d)
    upper = plus_product(params[p + 2], upper, d)
    return plus_product(params[p + 1], upper, d)


@shared
def slope(params: Floats, at: int, x: float) -> float:
    """df/dx."""
    p = _piece(params, at, x)
    d = x - params[p]
    upper = 3.0 * params[p + 4] + d * (4.0 * params[p + 5] + d * 5.0 * params[p + 6])
    return params[p + 2] + d * (2.0 * params[p + 3] + d * upper)


@shared
def side_of(params: Floats, at: int, x: float) -> float:
    """A number that differs between the sides of a kink: the slope of a straight piece, one and
    the same number for all pieces of a spline."""
    p = _piece(params, at, x)
    return _CURVED if _is_curved(params, p) else params[p + 2]


@shared
def interval_of(params: Floats, at: int, x: float) -> tuple[float, float]:
    """The ends of the interval around x in which the function has no kink, as `side_of` knows
    kinks; infinite where there is none."""
    p, here = _piece(params, at, x), side_of(params, at, x)
    points = int(params[at])
    piece = (p - at - 1 - points) // 8
    low, high = piece, piece  # of the points that x is between, the one above
    while low > 0 and side_of(params, at, _before(params, at, low)) == here:
        low -= 1
    while high < points and side_of(params, at, params[at + 1 + high]) == here:
        high += 1
    below = params[at + low] if low > 0 else -math.inf
    return below, params[at + 1 + high] if high < points else math.inf


@shared
def _before(params: Floats, at: int, n: int) -> float:
    """A place in the piece that ends where piece n begins."""
    x = params[at + n]
    return 0.5 * (params[at + n - 1] + x) if n > 1 else x - 1.0


@shared
def integral(params: Floats, at: int, x: float) -> float:
    """∫ f from the first point of the table to x; of points, so at most cubic."""
    p = _piece(params, at, x)
    d = x - params[p]
    inner = params[p + 2] / 2.0 + d * (params[p + 3] / 3.0 + d * params[p + 4] / 4.0)
    return params[p + 7] + d * (params[p + 1] + d * inner)

"""Steps of linear least squares: where they lead, what they gain, and jacobians behind them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats

ROUNDING = 1e-6  # of a number, or of its size: as far from a bound, or as much as a change


def best_step(value: Floats, J: Floats) -> Floats:
    """The step without limits that makes ½ |value + J step|² least."""
    norm = np.linalg.norm(J, axis=0)
    norm[norm == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(J / norm, -value, rcond=None)[0] / norm)


def best_gain(value: Floats, J: Floats) -> float:
    """By how much a step without limits makes ½ |value + J step|² smaller."""
    return 0.5 * float(np.sum((J @ best_step(value, J)) ** 2))


def compressed(value: Floats, J: Floats) -> Floats:
    """R (columns, columns) of [r A B], its first entry not negative."""
    columns = 1 + J.shape[1]
    whole = np.zeros((max(columns, value.size), columns))
    whole[: value.size, 0], whole[: value.size, 1:] = value, J
    R: Floats = np.linalg.qr(whole)[1]
    return -R if R[0, 0] < 0.0 else R


def secant(J: Floats, moved: Floats, off: Floats) -> Floats:
    """The jacobian nearest to J that tells the change of residuals over `moved`, which J tells
    but for `off` (Broyden); numbers count by what they change."""
    weight = np.sum(J**2, axis=0) * moved
    length = float(moved @ weight)
    return J + np.outer(off, weight / length) if length > 0.0 else J


def is_inside(x: Floats, lower: Floats, upper: Floats, size: Floats) -> NDArray[np.bool_]:
    """Which numbers are away from their bounds; `size`: of each, since a bound may be zero."""
    near = ROUNDING * np.maximum(np.abs(x), size)
    return np.asarray(np.minimum(x - lower, upper - x) > near)

"""Slopes by differences of eighth order, with several lengths of the step.

Of each number the estimate counts that differs least from the next finer one: a long step where
the law is smooth, a short one beside a kink. Steps that reach across a kink may agree with each
other, on the mean of the two slopes. Therefore the error has a second part, from the difference of
the slopes ahead and behind: this falls with the length of the step where the law is smooth, and
does not fall across a kink.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats

_WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
_ROUNDED = 4.0 * float(np.finfo(float).eps)
_AGREED = 1e-10  # part of a slope by which two estimates may differ: a finer one is not needed
_LEFT = 100.0  # times the rounding of one number: what it may leave of a slope
_ROUGH = 0.5  # part of a bend that the next finer step may keep; a tenth where the law is smooth


class DifferenceSlopes(NamedTuple):
    """Of numbers at 0: slopes; the error of each, without what rounding leaves; and the largest
    slope that the numbers have on the way."""

    slopes: Floats
    errors: Floats
    largest: Floats


def slope_at_zero(value: Callable[[float], Floats], steps: Sequence[float]) -> DifferenceSlopes:
    """The slopes at 0 of numbers.

    `steps`: lengths, from the longest, each a tenth of the one before, two or more.
    """
    middle = value(0.0)
    before = _slope(value, middle, steps[0])
    best, largest = before.slope, before.steepest
    error, rounding = np.full(best.shape, np.inf), np.zeros_like(best)
    for h in steps[1:]:
        finer = _slope(value, middle, h)
        bends = np.maximum(finer.bend - _ROUGH * before.bend, 0.0)
        differs = np.abs(finer.slope - before.slope) + bends + finer.noise
        rounding = np.where(differs < error, finer.noise, rounding)
        best, error = np.where(differs < error, before.slope, best), np.minimum(differs, error)
        if bool((error <= _AGREED * np.abs(best) + _LEFT * finer.noise).all()):
            break
        before = finer
    return DifferenceSlopes(best, np.maximum(error - _LEFT * rounding, 0.0), largest)


class _Estimate(NamedTuple):
    """With one step: slopes; by how much slopes ahead and behind differ; what rounding leaves; and
    the largest slope from the middle."""

    slope: Floats
    bend: Floats
    noise: Floats
    steepest: Floats


def _slope(value: Callable[[float], Floats], middle: Floats, h: float) -> _Estimate:
    slope, bend = np.zeros_like(middle), np.zeros_like(middle)
    highest, steepest = np.abs(middle), np.zeros_like(middle)
    for k, weight in enumerate(_WEIGHTS, 1):
        ahead, behind = value(k * h), value(-k * h)
        slope += (weight / h) * (ahead - behind)
        bend = np.maximum(bend, np.abs(ahead - 2.0 * middle + behind) / (k * h))
        highest = np.maximum(highest, np.maximum(np.abs(ahead), np.abs(behind)))
        away = np.maximum(np.abs(ahead - middle), np.abs(behind - middle))
        steepest = np.maximum(steepest, away / (k * h))
    return _Estimate(slope, bend, _ROUNDED * highest / h, steepest)

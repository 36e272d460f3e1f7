"""Slopes by differences of eighth order, with several lengths of the step.

Of each number the estimate counts that differs least from the next finer one: a long step where
the law is smooth, a short one beside a kink. Steps that reach across a kink may agree with each
other, on the mean of the two slopes. Therefore the error has a second part, from the difference of
the slopes ahead and behind: this falls with the length of the step where the law is smooth, and
does not fall across a kink.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from alf_ros.arrays import Floats

_WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
_ROUNDED = 4.0 * float(np.finfo(float).eps)
_AGREED = 1e-10  # part of a slope by which two estimates may differ: a finer one is not needed
_ROUGH = 0.5  # part of a bend that the next finer step may keep; a tenth where the law is smooth


def slope_at_zero(
    value: Callable[[float], Floats], steps: Sequence[float]
) -> tuple[Floats, Floats]:
    """The slopes at 0 of numbers, and the error of each.

    `steps`: lengths, from the longest, each a tenth of the one before, two or more.
    """
    middle = value(0.0)
    before, bend, noise = _slope(value, middle, steps[0])
    best, error = before, np.full(before.shape, np.inf)
    for h in steps[1:]:
        finer, bends, following = _slope(value, middle, h)
        differs = np.abs(finer - before) + np.maximum(bends - _ROUGH * bend, 0.0) + noise
        best, error = np.where(differs < error, before, best), np.minimum(differs, error)
        if bool((error <= _AGREED * np.abs(best) + 100.0 * noise).all()):
            break
        before, bend, noise = finer, bends, following
    return best, error


def _slope(
    value: Callable[[float], Floats], middle: Floats, h: float
) -> tuple[Floats, Floats, float]:
    """With a step h; by how much slopes ahead and behind differ; and what rounding leaves."""
    slope, bend, largest = np.zeros_like(middle), np.zeros_like(middle), 0.0
    for k, weight in enumerate(_WEIGHTS, 1):
        ahead, behind = value(k * h), value(-k * h)
        slope += (weight / h) * (ahead - behind)
        bend = np.maximum(bend, np.abs(ahead - 2.0 * middle + behind) / (k * h))
        largest = max(largest, float(np.abs(ahead).max(initial=0.0)))
    return slope, bend, _ROUNDED * largest / h

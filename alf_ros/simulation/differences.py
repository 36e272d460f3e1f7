"""Derivatives by central differences of eighth order, checked by differences of sixth order.

The step of a number is a small part of it, so that the difference of a smooth function is off by
about 1e-12 of the function. Where the two orders differ, the function has a kink or a jump.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError

OFFSETS = (-4, -3, -2, -1, 1, 2, 3, 4)  # of the places, in steps
_EIGHTH = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
_SIXTH = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0, 0.0)
_AGREE = 1e-5  # of the largest slope, and
_ROUNDED = 1e-11  # of the largest value a step, by which the two orders may differ
_NOTHING = 1e-25  # in SI units: a value that is rounding, as the energy of a spring at its length


def slope(values: Floats, step: float, name: str, what: str, size: float = 0.0) -> Floats:
    """(…,) the derivative of values (8, …) at `OFFSETS` steps around a place.

    name: of the number, what: of the function; size: of the terms that it sums, whose rounding it
    has. Raises InputError if it is not smooth there.
    """
    found, lower = _orders(values, step)
    most = _AGREE * np.abs(found).max(initial=0.0)
    most += (_ROUNDED * np.abs(values).max(initial=size) + _NOTHING) / step
    if not np.abs(found - lower).max(initial=0.0) <= most:
        raise InputError(f'{what} has no derivative by it here: it has a kink or a jump', key=name)
    return np.asarray(found)


def doubt(values: Floats, step: float) -> float:
    """By how much the two orders of the derivative of such values differ: rounding, or the part of
    a kink within the steps that `slope` still takes."""
    found, lower = _orders(values, step)
    return float(np.abs(found - lower).max(initial=0.0))


def _orders(values: Floats, step: float) -> tuple[Floats, Floats]:
    found, lower = (
        np.tensordot([np.sign(k) * w[abs(k) - 1] for k in OFFSETS], values, axes=(0, 0)) / step
        for w in (_EIGHTH, _SIXTH)
    )
    return np.asarray(found), np.asarray(lower)

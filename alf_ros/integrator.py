"""Explicit Runge-Kutta methods as their tableaux; the kernel steps any of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats


class Tableau(NamedTuple):
    """Butcher's a (s, s), b (s,), c (s,) and the order of the method."""

    a: Floats
    b: Floats
    c: Floats
    order: int


def _rk4() -> Tableau:
    """Kutta (1901), the classical method."""
    a = np.zeros((4, 4))
    a[1, 0], a[2, 1], a[3, 2] = 0.5, 0.5, 1.0
    return Tableau(a, np.array([1.0, 2.0, 2.0, 1.0]) / 6.0, np.array([0.0, 0.5, 0.5, 1.0]), 4)


TABLEAUX = {'rk4': _rk4()}

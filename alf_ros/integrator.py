"""Explicit Runge-Kutta methods as their tableaux; the kernel steps any of them.

`rk4` and `dop853` take the step of the scene; `dop853_adaptive` takes as many steps between two
grid points as its tolerance asks for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from alf_ros.arrays import Floats
from alf_ros.kernel import Method
from alf_ros.scene import Solver


class Tableau(NamedTuple):
    """Butcher's a (s, s), b (s,), c (s,), the order, for an adaptive method the weights of its
    embedded errors (2, s), and whether it errs less with q̇ as the stages carry it."""

    a: Floats
    b: Floats
    c: Floats
    order: int
    embedded: Floats = np.zeros(0)
    carried: bool = False


def _rk4() -> Tableau:
    """Kutta (1901), the classical method."""
    a = np.zeros((4, 4))
    a[1, 0], a[2, 1], a[3, 2] = 0.5, 0.5, 1.0
    return Tableau(a, np.array([1.0, 2.0, 2.0, 1.0]) / 6.0, np.array([0.0, 0.5, 0.5, 1.0]), 4)


# Dormand & Prince of order 8 (Hairer, Nørsett & Wanner 1993, II.5 and II.10), as SciPy has it
_A, _B, _C = (np.ascontiguousarray(part) for part in (DOP853.A, DOP853.B, DOP853.C))
_DOP853 = Tableau(_A, _B, _C, 8, carried=True)

TABLEAUX = {
    'rk4': _rk4(),
    'dop853': _DOP853,
    'dop853_adaptive': _DOP853._replace(embedded=np.array([DOP853.E5[:-1], DOP853.E3[:-1]])),
}


def method(solver: Solver) -> Method:
    """What the kernel has to know of a scene's solver section."""
    a, b, c, _, embedded, carried = TABLEAUX[solver.integrator]
    iterations = np.uint64(solver.iterations)
    return Method(a, b, c, embedded, np.uint64(carried), iterations, solver.tolerance)

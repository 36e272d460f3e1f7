"""Loops over vectors. Slices would do, but their error messages take seconds to compile."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.jit import inlined, inner


@inlined
def zero(to: Floats) -> None:
    """to = 0."""
    for i in range(to.size):
        to[i] = 0.0


@inlined
def copy(of: Floats | Integers, to: Floats | Integers) -> None:
    """to = of, which is as long or longer."""
    for i in range(to.size):
        to[i] = of[i]


@inner
def largest(v: Floats, n: np.uint64) -> float:
    """Largest of the first n numbers, without sign."""
    most = 0.0
    for i in range(n):
        most = max(most, abs(v[i]))
    return most


@inner
def furthest(u: Floats, v: Floats, n: np.uint64) -> float:
    """Largest difference of the first n numbers, without sign."""
    most = 0.0
    for i in range(n):
        most = max(most, abs(u[i] - v[i]))
    return most

"""The vector of a distance or of a place: rows 0 to D - 1 of a scalar (`scalars`), in one pass.

All of them have the same blocks and no terms: r = c + Σ C q. In the plane the third component is
0. So a spring reads its gap once, and pushes along it.
"""

from __future__ import annotations

import math

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.jit import shared
from alf_ros.kernel.numba_ext.plain_loops import each


@shared
def size(x: float, y: float, z: float) -> float:
    """√(x² + y² + z²)."""
    return math.sqrt(x * x + y * y + z * z)


@shared
def _plus_sum(
    u: Floats, slots: Integers, params: Floats, n: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """(x, y, z) + Σ C u of instance n."""
    D = slots[0]
    row = slots[2 + 5 * n + 3]
    i, j = slots[row], slots[row + 1]
    entries = slots[i]
    whole = 1 + entries * D  # params of a row
    for _ in each(0, entries):
        i += 1
        b = slots[i] * D
        i += 1
        for c in each(0, D):
            j += 1
            v = u[b + np.int64(c)]
            x = plus_product(x, params[j], v)
            y = plus_product(y, params[j + whole], v)
            if D == 3:
                z = plus_product(z, params[j + 2 * whole], v)
    return x, y, z


@shared
def vector(q: Floats, slots: Integers, params: Floats, n: int) -> tuple[float, float, float]:
    """c + Σ C q of instance n, m: the gap of a distance, or the place."""
    row = slots[2 + 5 * n + 3]
    j, whole = slots[row + 1], 1 + slots[slots[row]] * slots[0]
    z = 0.0
    if slots[0] == 3:
        z = params[j + 2 * whole]
    return _plus_sum(q, slots, params, n, params[j], params[j + whole], z)


@shared
def vector_rate(qd: Floats, slots: Integers, params: Floats, n: int) -> tuple[float, float, float]:
    """Σ C q̇ of instance n, m/s."""
    return _plus_sum(qd, slots, params, n, 0.0, 0.0, 0.0)


@shared
def push_vector(
    slots: Integers, params: Floats, n: int, X: float, Y: float, Z: float, Q: Floats
) -> None:
    """Q += Cᵀ F of instance n, F = (X, Y, Z), N."""
    D = slots[0]
    row = slots[2 + 5 * n + 3]
    i, j = slots[row], slots[row + 1]
    entries = slots[i]
    whole = 1 + entries * D
    for _ in each(0, entries):
        i += 1
        b = slots[i] * D
        i += 1
        for c in each(0, D):
            j += 1
            k = b + np.int64(c)
            force = plus_product(Q[k], params[j], X)
            force = plus_product(force, params[j + whole], Y)
            if D == 3:
                force = plus_product(force, params[j + 2 * whole], Z)
            Q[k] = force


@shared
def push_distance(
    slots: Integers,
    params: Floats,
    n: int,
    F: float,
    length: float,
    x: float,
    y: float,
    z: float,
    Q: Floats,
) -> None:
    """Q += F ∂l/∂q of a distance of known length l and vector (m), as `size` and `vector` give
    them: F is an effort on it, N. Where it is zero it has no direction, and nothing is added."""
    if length > 0.0:
        F /= length
        push_vector(slots, params, n, F * x, F * y, F * z, Q)

"""LU of a dense matrix, for the formulations that have one: O(N³), which is part of comparing.

LAPACK is unsuitable: it allocates in every stage, and solves nearly singular systems.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Indices
from alf_ros.kernel.data import EPS
from alf_ros.kernel.numba_ext.jit import ONE, inner


@inner
def factorise(N: np.uint64, matrix: Floats, swap: Indices) -> bool:
    """P A = L U in place, by rows, largest pivots first; returns False if A is singular.

    A is singular if a pivot is below working precision of the largest element: A must be scaled.
    """
    largest = 0.0
    for i in range(N * N):
        largest = max(largest, abs(matrix[i]))
    for k in range(N):
        at = k
        for i in range(k + ONE, N):
            if abs(matrix[i * N + k]) > abs(matrix[at * N + k]):
                at = i
        swap[k] = at
        if not abs(matrix[at * N + k]) > EPS * N * largest:
            return False
        for j in range(N):
            matrix[k * N + j], matrix[at * N + j] = matrix[at * N + j], matrix[k * N + j]
        for i in range(k + ONE, N):
            s = matrix[i * N + k] / matrix[k * N + k]
            matrix[i * N + k] = s
            for j in range(k + ONE, N):
                matrix[i * N + j] -= s * matrix[k * N + j]
    return True


@inner
def solve(N: np.uint64, matrix: Floats, swap: Indices, x: Floats) -> None:
    """x = A⁻¹ x with the factors in `matrix`."""
    for k in range(N):
        x[k], x[swap[k]] = x[swap[k]], x[k]
    for i in range(N):
        for j in range(i):
            x[i] -= matrix[i * N + j] * x[j]
    for back in range(N):
        i = N - ONE - back
        for j in range(i + ONE, N):
            x[i] -= matrix[i * N + j] * x[j]
        x[i] /= matrix[i * N + i]

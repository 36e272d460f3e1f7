"""Generalised conjugate residuals: a Krylov method for linear equations of which products with the
matrix are known, and nothing else."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data.tangents import DIRECTIONS
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.lane_numbers import pick
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import Lanes

MOST = np.uint64(DIRECTIONS)  # until it is begun anew
RESTARTS = 8  # at most


@inner
def step_along(
    search: Lanes, n: np.uint64, j: np.uint64, x: Lanes, r: Lanes, image: Lanes
) -> Lanes:
    """Move x and its residual r (n numbers each) along r, which is mapped to `image`, and is made
    direction j of `search` (2, MOST, numbers). Returns the largest of r."""
    whole = image.size
    p, u = section(search, j * whole, whole), section(search, (MOST + j) * whole, whole)
    for a in each(0, n):
        p[a], u[a] = r[a], image[a]
    for i in range(j):
        along = section(search, i * whole, whole)
        to = section(search, (MOST + i) * whole, whole)
        part = 0.0 * r[0]
        for a in each(0, n):
            part += to[a] * u[a]
        for a in each(0, n):
            p[a] -= part * along[a]
            u[a] -= part * to[a]
    square = 0.0 * r[0]
    for a in each(0, n):
        square += u[a] * u[a]
    scale = 1.0 / np.sqrt(pick(square > 0.0, square, 1.0))
    part = 0.0 * r[0]
    for a in each(0, n):
        p[a], u[a] = scale * p[a], scale * u[a]
        part += u[a] * r[a]
    left = 0.0 * r[0]
    for a in each(0, n):
        x[a] += part * p[a]
        r[a] -= part * u[a]
        left = max(left, abs(r[a]))
    return left

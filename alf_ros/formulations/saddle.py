"""The classical matrix [M Φ_qᵀ; Φ_q 0], dense, and its solutions.

It has an inverse only where the rows of Φ_q are independent: not in a singular position, and
nowhere with redundant rows. At a singular value s of Φ_q its condition is 1/s².
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.formulations import dense
from alf_ros.formulations.storage import Storage, inner
from alf_ros.kernel import System, Work, add_mass_times, jacobian, times_jacobian, zero


@inner
def factorise(unit: Unit, system: System, work: Work, storage: Storage) -> bool:
    """LU of [M/μ (sΦ_q)ᵀ; sΦ_q 0] at q in `work`; returns False where it is singular.

    The mean mass μ and the scales s of the rows take the units out of the pivots.
    """
    n, m = np.uint64(work.p.size), np.uint64(storage.phi.size)
    N, rows, matrix, e = n + m, system.rows, storage.matrix, work.delta
    jacobian(unit, rows, work.q, work.g, work.g2)
    zero(matrix)
    for j in range(n):
        zero(e)
        e[j] = 1.0
        zero(storage.f)
        add_mass_times(unit, system.mass, 1.0 / storage.mass_scale, e, storage.f)
        times_jacobian(unit, rows, work.g, work.g2, e, work.rate)
        for i in range(n):
            matrix[i * N + j] = storage.f[i]
        for r in range(m):
            matrix[(n + r) * N + j] = rows.scale[r] * work.rate[r]
            matrix[j * N + n + r] = rows.scale[r] * work.rate[r]
    return dense.factorise(N, matrix, storage.swap)


@inner
def solve(system: System, storage: Storage, f: Floats, c: Floats, x: Floats, z: Floats) -> None:
    """M x + Φ_qᵀ z = f, Φ_q x = c, with the factors in `storage`."""
    m = np.uint64(c.size)
    n = np.uint64(storage.right.size) - m
    scale, right = system.rows.scale, storage.right
    for i in range(n):
        right[i] = f[i] / storage.mass_scale
    for r in range(m):
        right[n + r] = scale[r] * c[r]
    dense.solve(n + m, storage.matrix, storage.swap, right)
    for i in range(n):
        x[i] = right[i]
    for r in range(m):
        z[r] = storage.mass_scale * scale[r] * right[n + r]

"""The classical matrix [M Φ_qᵀ; Φ_q 0], dense, and its solutions.

It has an inverse only where the rows of Φ_q are independent: not in a singular position, and
nowhere with redundant rows. At a singular value s of Φ_q its condition is 1/s².
"""

from __future__ import annotations

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import jacobian, times_jacobian
from alf_ros.kernel.data import System, Work
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import zero
from alf_ros.simulation.formulations import dense_lu
from alf_ros.simulation.formulations.storage import Storage


@inner
def factorise(unit: Unit, system: System, work: Work, storage: Storage) -> bool:
    """LU of the matrix at q in `work`; returns False where it is singular.

    M is divided by the mean mass and Φ_q by the scales of its rows: pivots have no units.
    """
    n, m = work.p.size, storage.phi.size
    N, rows, matrix, e = n + m, system.rows, storage.matrix, work.delta
    jacobian(unit, rows, work.q, work.g, work.g2)
    zero(matrix)
    for j in range(n):
        zero(e)
        e[j] = 1.0
        zero(storage.f)
        add_mass_times(unit, system.mass, 1.0 / storage.mass_scale, e, storage.f)
        times_jacobian(unit, rows, work.g, work.g2, e, storage.phi_d)
        for i in range(n):
            matrix[i * N + j] = storage.f[i]
        for r in range(m):
            matrix[(n + r) * N + j] = rows.scale[r] * storage.phi_d[r]
            matrix[j * N + n + r] = rows.scale[r] * storage.phi_d[r]
    return dense_lu.factorise(N, matrix, storage.swap)


@inner
def solve(system: System, storage: Storage, f: Floats, c: Floats, x: Floats, z: Floats) -> None:
    """M x + Φ_qᵀ z = f, Φ_q x = c, with the factors in `storage`."""
    m = c.size
    n = storage.right.size - m
    scale, right = system.rows.scale, storage.right
    for i in range(n):
        right[i] = f[i] / storage.mass_scale
    for r in range(m):
        right[n + r] = scale[r] * c[r]
    dense_lu.solve(n + m, storage.matrix, storage.swap, right)
    for i in range(n):
        x[i] = right[i]
    for r in range(m):
        z[r] = storage.mass_scale * scale[r] * right[n + r]

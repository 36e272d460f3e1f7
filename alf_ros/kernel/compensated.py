"""Φ(q) to twice the digits of q, for places beside a singular position.

There a combination of rows is about to lose its direction. An error e of Φ in this combination
moves the place by e / x along the other branch and bends the path by e / x³, x the distance. The
rounding of q does not matter, because the gradient of just that combination is as small as x; only
the rounding of Φ itself does. Products and sums are therefore stored with their rounding errors
(Dekker 1971; Ogita, Rump & Oishi 2005, algorithms 3.1 and 3.3 with a fused multiply-add).
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Rows
from alf_ros.kernel.numba_ext.calls import fused
from alf_ros.kernel.numba_ext.jit import ONE, ZERO, inlined, inner


@inlined
def exact_product(a: float, b: float) -> tuple[float, float]:
    """a b, and its rounding error."""
    p = a * b
    return p, fused(a, b, -p)


@inlined
def exact_sum(a: float, b: float) -> tuple[float, float]:
    """a + b, and its rounding error."""
    s = a + b
    z = s - a
    return s, (a - (s - z)) + (b - z)


@inner
def violation_twofold(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> None:
    """Φ(q), as `constraints.violation`."""
    D = np.uint64(len(unit))
    m1 = rows.i.size
    for r in range(m1):
        i, j = rows.i[r] * D, rows.j[r] * D
        high, low = -rows.length2[r], 0.0
        for a in range(D):
            d, rest = exact_sum(q[i + a], -q[j + a])
            square, less = exact_product(d, d)
            high, lost = exact_sum(high, square)
            low += lost + less + 2.0 * d * rest
        phi[r] = 0.5 * (high + low)
    for r in range(rows.c.size):
        high, low = rows.c[r], 0.0
        for e in range(rows.first[r], rows.first[r + ONE]):
            i = rows.block[e] * D
            for a in range(D):
                part, less = exact_product(rows.b[e * D + a], q[i + a])
                high, lost = exact_sum(high, part)
                low += lost + less
            for n in range(rows.first_term[e], rows.first_term[e + ONE]):
                j = rows.term_block[n] * D
                full = rows.full[n] != 0
                for a in range(D):
                    for c in range(ZERO if full else a, D if full else a + ONE):
                        term, rest = exact_product(0.5 * rows.term[(n * D + a) * D + c], q[j + c])
                        part, less = exact_product(q[i + a], term)
                        high, lost = exact_sum(high, part)
                        low += lost + less + q[i + a] * rest
        phi[m1 + r] = high + low
    for r in range(m1 + rows.c.size, phi.size):
        phi[r] = 0.0

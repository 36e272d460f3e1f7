"""tr(M A⁻¹) from the factor of A, in the time of another factorisation.

With s_k the singular values of α^½ Φ_q M^-½, n - tr(M A⁻¹) = Σ s_k² / (1 + s_k²): each independent
row counts one, each dependent one zero, and a row about to become dependent counts in between, at
the scale at which the multipliers of the step feel it too.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Pattern
from alf_ros.kernel.numba_ext.jit import ONE, TWO, compiled


@compiled
def mass_trace(
    unit: Unit,
    pattern: Pattern,
    diagonal: Floats,
    off: Floats,
    column: Floats,
    Z: Floats,
    Zo: Floats,
) -> float:
    """tr(M A⁻¹) = n - Σ s_k² / (1 + s_k²).

    It needs A⁻¹ only where M is, which is within the pattern of the factor: selected inversion
    (Takahashi, Fagan & Chen 1973), in the time of a factorisation. From the last column:
    Z_ik = -Σ_j Z_ij B_jk,  Z_kk = A_kk⁻¹ - Σ_j B_jkᵀ Z_jk, with B_jk = L_jk L_kk⁻¹.
    """
    D = np.uint64(len(unit))
    DD = D * D
    n = pattern.first.size - ONE
    update = pattern.target.size
    trace = 0.0
    for back in range(n):
        k = n - ONE - back
        kk, start = k * DD, pattern.first[k]
        count = pattern.first[k + ONE] - start
        for e in range(count):  # B = L L_kk⁻¹, column by column of L_kk from the last
            for a in range(D):
                for up in range(D):
                    c = D - ONE - up
                    v = off[(start + e) * DD + a * D + c]
                    for b in range(c + ONE, D):
                        v -= column[e * DD + a * D + b] * diagonal[kk + b * D + c]
                    column[e * DD + a * D + c] = v
        for e in range(start * DD, (start + count) * DD):
            Zo[e] = 0.0
        update -= count * (count - ONE) // TWO
        at = update
        for e in range(count):
            i, ii = (start + e) * DD, pattern.row[start + e] * DD
            for f in range(e):
                low, j = pattern.target[at] * DD, (start + f) * DD
                at += ONE
                for a in range(D):
                    for c in range(D):
                        for b in range(D):
                            Zo[i + a * D + c] -= Zo[low + a * D + b] * column[f * DD + b * D + c]
                            Zo[j + a * D + c] -= Zo[low + b * D + a] * column[e * DD + b * D + c]
            for a in range(D):
                for c in range(D):
                    for b in range(D):
                        Zo[i + a * D + c] -= Z[ii + a * D + b] * column[e * DD + b * D + c]
        # the block itself: first (L D Lᵀ)⁻¹ of the pivot block, by columns of the unit matrix
        for c in range(D):
            for a in range(D):
                v = 1.0 if a == c else 0.0
                for b in range(a):
                    v -= diagonal[kk + a * D + b] * Z[kk + b * D + c]
                Z[kk + a * D + c] = v
            for a in range(D):
                Z[kk + a * D + c] *= diagonal[kk + a * D + a]
            for up in range(ONE, D):
                a = D - ONE - up
                for b in range(a + ONE, D):
                    Z[kk + a * D + c] -= diagonal[kk + b * D + a] * Z[kk + b * D + c]
        for a in range(D):
            for c in range(D):
                v = Z[kk + a * D + c]
                for e in range(count):
                    for b in range(D):
                        v -= column[e * DD + b * D + a] * Zo[(start + e) * DD + b * D + c]
                Z[kk + a * D + c] = v
                trace += pattern.mass_diagonal[kk + a * D + c] * v
        for e in range(start * DD, (start + count) * DD):
            trace += 2.0 * pattern.mass_off[e] * Zo[e]
    return trace

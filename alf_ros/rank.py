"""Rank of Φ_q from the factor of A, in the time of another factorisation.

With s_k the singular values of α^½ Φ_q M^-½, n - tr(M A⁻¹) = Σ s_k² / (1 + s_k²): every
independent row counts one, every dependent one nothing, and a row about to become dependent
counts in between, at the scale at which the multipliers of the step feel it too. The trace needs
A⁻¹ only where M is, which is within the pattern of the factor: selected inversion (Takahashi,
Fagan, Chen 1973; Erisman & Tinney, Comm. ACM 18, 1975).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from alf_ros.arrays import Floats, Indices, Unit
from alf_ros.kernel import Work
from alf_ros.model import Model


def effective_rank(model: Model, work: Work) -> float:
    """n - tr(M A⁻¹) with the factor in `work`: the rank of Φ_q, not rounded."""
    pattern = model.system.pattern
    return model.n - _trace(
        model.unit,
        pattern.first,
        pattern.row,
        pattern.target,
        pattern.mass_diagonal,
        pattern.mass_off,
        work.diagonal.copy(),
        work.off.copy(),
    )


@njit(cache=True, nogil=True, error_model='numpy')
def _trace(
    unit: Unit,
    first: Indices,
    row: Indices,
    target: Indices,
    mass_diagonal: Floats,
    mass_off: Floats,
    Z: Floats,
    B: Floats,
) -> float:
    """tr(M A⁻¹); the factor (Z diagonal blocks, B blocks below) is overwritten by the inverse.

    From the last column: Z_ik = -Σ_j Z_ij B_jk, Z_kk = A_kk⁻¹ - Σ_j B_jkᵀ Z_jk, j over the column
    of k.
    """
    D = len(unit)
    DD = D * D
    n = first.size - 1
    longest = 0
    for k in range(n):
        longest = max(longest, np.int64(first[k + 1]) - np.int64(first[k]))
    column = np.zeros(max(1, longest) * DD)
    inverse = np.zeros((D, D))
    update = np.int64(target.size)
    trace = 0.0
    for k in range(n - 1, -1, -1):
        start, count = np.int64(first[k]), np.int64(first[k + 1]) - np.int64(first[k])
        for c in range(D):  # columns of L_kk⁻¹, unit lower
            for a in range(D):
                s = 1.0 if a == c else 0.0
                for b in range(a):
                    s -= Z[k * DD + a * D + b] * inverse[b, c]
                inverse[a, c] = s
        for s in range(count):  # B_jk = L_jk L_kk⁻¹ of the block-unit factor
            for a in range(D):
                for c in range(D):
                    v = 0.0
                    for b in range(D):
                        v += B[(start + s) * DD + a * D + b] * inverse[b, c]
                    column[s * DD + a * D + c] = v
        for s in range(count * DD):
            B[start * DD + s] = 0.0
        update -= count * (count - 1) // 2
        at = update
        for s in range(count):
            for r in range(s):
                low = np.int64(target[at]) * DD  # block (row s, row r) of the inverse
                at += 1
                for a in range(D):
                    for c in range(D):
                        for b in range(D):
                            B[(start + s) * DD + a * D + c] -= (
                                B[low + a * D + b] * column[r * DD + b * D + c]
                            )
                            B[(start + r) * DD + a * D + c] -= (
                                B[low + b * D + a] * column[s * DD + b * D + c]
                            )
            diagonal = np.int64(row[start + s]) * DD
            for a in range(D):
                for c in range(D):
                    for b in range(D):
                        B[(start + s) * DD + a * D + c] -= (
                            Z[diagonal + a * D + b] * column[s * DD + b * D + c]
                        )
        pivots = np.zeros(D)
        for b in range(D):
            pivots[b] = Z[k * DD + b * D + b]
        for a in range(D):
            for c in range(D):
                v = 0.0
                for b in range(D):
                    v += inverse[b, a] * pivots[b] * inverse[b, c]
                for s in range(count):
                    for b in range(D):
                        v -= column[s * DD + b * D + a] * B[(start + s) * DD + b * D + c]
                Z[k * DD + a * D + c] = v
                trace += mass_diagonal[k * DD + a * D + c] * v
        for s in range(start * DD, (start + count) * DD):
            trace += 2.0 * mass_off[s] * B[s]
    return trace

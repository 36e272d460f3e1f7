"""Losses: how much a large residual counts.

With a loss ρ the fit minimises ½ Σ ρ(r²) of residuals r in units of their noise. It does so as a
sum of squares ½ Σ φ(r)², φ = sign(r) √ρ(r²), whose derivatives are exact. Names and formulas
are as in scipy.optimize.least_squares; from `KNEE` on, a residual counts less.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats

NAMES = ('linear', 'huber', 'soft_l1', 'cauchy')
KNEE = 2.0  # times the noise
_SMALL = 1e-8


def rooted(name: str, r: Floats) -> tuple[Floats, Floats]:
    """φ(r) and dφ/dr of residuals in units of the noise."""
    if name == 'linear':
        return r, np.ones_like(r)
    x = np.abs(r) / KNEE
    if name == 'huber':
        outer = np.sqrt(2.0 * np.maximum(x, 1.0) - 1.0)
        size, slope = np.where(x <= 1.0, x, outer), np.where(x <= 1.0, 1.0, 1.0 / outer)
    elif name == 'soft_l1':
        root = np.sqrt(1.0 + x * x)
        size = x * np.sqrt(2.0 / (1.0 + root))  # √(2 (√(1 + x²) - 1)) without cancellation
        slope = np.where(x > _SMALL, x / (np.maximum(size, _SMALL) * root), 1.0)
    else:
        size = np.sqrt(np.log1p(x * x))
        slope = np.where(x > _SMALL, x / (np.maximum(size, _SMALL) * (1.0 + x * x)), 1.0)
    return np.sign(r) * KNEE * size, slope


def spread(name: str, r: Floats) -> float:
    """By how much the variance of an estimate is more than (JᵀJ)⁻¹ with this loss: E[ψ²] / E[ψ']²,
    ψ = φ dφ/dr (Huber)."""
    if name == 'linear':
        return 1.0
    step = 1e-5

    def psi(at: Floats) -> Floats:
        value, slope = rooted(name, at)
        return value * slope

    slopes = (psi(r + step) - psi(r - step)) / (2.0 * step)
    return float(np.mean(psi(r) ** 2) / np.mean(slopes) ** 2)

"""Tests of residuals: whether what a fit leaves is white noise, as its intervals assume.

- Durbin & Watson: Σ (r_k - r_{k-1})² / Σ r_k², 2 for white noise, less if neighbours are alike.
- Ljung & Box, Biometrika 65 (1978), 297: N (N + 2) Σ ρ_k² / (N - k) over lags, χ² distributed.
- Wald & Wolfowitz: the number of runs of one sign, normally distributed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from alf_ros.arrays import Floats

_LAGS = 10
_UNLIKELY = 0.01


@dataclass(frozen=True)
class Whiteness:
    """durbin_watson, and the probabilities of at least such a Ljung-Box statistic and of at least
    such a number of runs, for white noise."""

    durbin_watson: float
    ljung_box: float
    runs: float

    @property
    def white(self) -> bool:
        """Whether both tests find nothing, at 1 %."""
        return self.ljung_box >= _UNLIKELY and self.runs >= _UNLIKELY


def whiteness(parts: Sequence[Floats]) -> Whiteness:
    """Of the residuals of one channel: a sequence (N,) of each window. NaN where too few are."""
    parts = [part for part in parts if part.size > 1]
    whole = np.concatenate([np.zeros(0), *parts])
    square = float(whole @ whole)
    if not square > 0.0:
        return Whiteness(np.nan, np.nan, np.nan)
    steps = sum(float(np.sum(np.diff(part) ** 2)) for part in parts)
    return Whiteness(steps / square, _ljung_box(parts, square), _runs(parts))


def _ljung_box(parts: Sequence[Floats], square: float) -> float:
    """Autocorrelations within windows, pooled over them."""
    total = sum(part.size for part in parts)
    lags = min(_LAGS, max(part.size for part in parts) // 4)
    if lags < 1:
        return float('nan')
    statistic = 0.0
    for lag in range(1, lags + 1):
        pairs = sum(max(0, part.size - lag) for part in parts)
        rho = sum(float(part[lag:] @ part[:-lag]) for part in parts if part.size > lag) / square
        statistic += total * (total + 2.0) * rho * rho / max(1, pairs)
    return float(stats.chi2.sf(statistic, lags))


def _runs(parts: Sequence[Floats]) -> float:
    """Each window against its own median."""
    found = mean = variance = 0.0
    for part in parts:
        above = part > np.median(part)
        a, b = float(above.sum()), float((~above).sum())
        n = a + b
        if a == 0.0 or b == 0.0 or n < 3.0:
            continue
        found += 1.0 + float((above[1:] != above[:-1]).sum())
        mean += 1.0 + 2.0 * a * b / n
        variance += 2.0 * a * b * (2.0 * a * b - n) / (n * n * (n - 1.0))
    if variance <= 0.0:
        return float('nan')
    return float(2.0 * stats.norm.sf(abs(found - mean) / np.sqrt(variance)))

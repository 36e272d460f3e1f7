"""How well a recording determines the numbers: their covariance, and undetermined combinations.

With r = A u + B θ, of residuals in units of their noise, starts u and shared numbers θ, B⊥
is the part of B at right angles to A. For θ = θ₀ + D x, with D the size
of each number, each singular value σ of B⊥ D with its direction v says: vᵀ x is known to 1/σ. A
combination that is known to no better than its own size is not determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats

_UNSEEN = 1e-8  # singular value, of the largest, from which down rounding decides
_NOTHING = 1e-6  # singular value of rounding: known to a million times its size, or worse
_PART = 0.2  # of the largest part of a combination, from which on a number is named; and
_SMALL = 5e-3  # the same if it is not determined: all that can replace each other are named


@dataclass(frozen=True)
class Combination:
    """Σ parts · (change of a number in parts of its size); the parts have the norm 1.

    deviation: how well the recording determines it, relative: 0.01 is 1 %; infinite if not at
    all.
    """

    parts: dict[str, float]
    deviation: float

    @property
    def determined(self) -> bool:
        """Whether its deviation is below 100 %."""
        return self.deviation < 1.0

    @property
    def text(self) -> str:
        """The numbers that take part, the largest shown part first; equal ones in their order."""
        largest = max(map(abs, self.parts.values()))
        least = largest * (_PART if self.determined else _SMALL)
        some = [(n, x) for n, x in self.parts.items() if abs(x) >= least]
        some.sort(key=lambda each: -round(abs(each[1]), 2))
        sign = 1.0 if some[0][1] > 0.0 else -1.0
        return ' '.join(f'{sign * x:+.2f} {n}' for n, x in some).removeprefix('+')


@dataclass(frozen=True, eq=False)
class Knowledge:
    """covariance (P, P) of the shared numbers; a number in a combination that is not seen at all
    has an infinite variance. correlations (P, P): with such a combination their limit, ±1 within
    it. singular (P,): σ, descending; combinations: of each σ.

    root (P, P): rootᵀ root is the information, B⊥ᵀ B⊥ with the priors. sizes (P,) of the
    numbers; spread: the factor of the variance that the loss brings.
    """

    covariance: Floats
    correlations: Floats
    singular: Floats
    combinations: tuple[Combination, ...]
    root: Floats
    sizes: Floats
    spread: float

    @property
    def deviations(self) -> Floats:
        """Standard deviations (P,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def relative(self) -> Floats:
        """(P,) how well the combinations are known, the least known one first."""
        return np.array([each.deviation for each in reversed(self.combinations)])

    @property
    def untold(self) -> int:
        """How many combinations are not seen at all."""
        return int(np.isinf(self.relative).sum())

    @property
    def volume(self) -> float:
        """The geometric mean of the deviations of the combinations that are seen; its P-th power
        is the volume of the confidence ellipsoid but for a constant. NaN if none is seen."""
        seen = self.relative[self.untold :]
        return float(np.exp(np.log(seen).mean())) if seen.size else float('nan')

    def with_more(self, parts: Sequence[Floats]) -> Knowledge:
        """With further measurements: B⊥ of their windows (N, P), of the same numbers."""
        names = list(self.combinations[0].parts)
        return known(names, parts, self.sizes, self.root, self.spread)


def beside(A: Floats, B: Floats) -> Floats:
    """B⊥ (N, P): the part of B that no change of a start, A (N, u), explains."""
    if not A.size:
        return B
    U, s, _ = np.linalg.svd(A, full_matrices=False)
    U = U[:, s > _UNSEEN * s.max(initial=0.0)]
    return np.asarray(B - U @ (U.T @ B))


def known(
    names: Sequence[str], parts: Sequence[Floats], sizes: Floats, extra: Floats, spread: float
) -> Knowledge:
    """Of B⊥ of all windows (N, P), sizes (P,) of the numbers, rows of priors (P, P), and the
    factor of the variance that the loss brings."""
    P = len(names)
    whole = np.vstack([*parts, extra])
    norm = np.linalg.norm(whole, axis=0)
    root: Floats = np.linalg.qr(np.vstack([whole, np.zeros((P, P))]))[1]
    _, s, Vt = np.linalg.svd(root * sizes)
    least = max(_UNSEEN * s.max(initial=0.0), _NOTHING)
    factor = np.sqrt(spread)
    seen = s > least
    combinations = tuple(
        Combination(dict(zip(names, row.tolist(), strict=True)), factor / x if yes else np.inf)
        for x, row, yes in zip(s.tolist(), Vt, seen.tolist(), strict=True)
    )
    half = sizes[:, None] * Vt.T * (factor / np.maximum(s, least))
    limit = half @ half.T
    spreads = np.sqrt(np.diag(limit))
    half = half[:, seen]
    covariance = half @ half.T
    unseen = (np.abs(Vt[~seen]) > np.sqrt(_UNSEEN)).any(axis=0) | (norm == 0.0)
    covariance[unseen] = covariance[:, unseen] = 0.0
    covariance[unseen, unseen] = np.inf
    correlations = limit / np.outer(spreads, spreads)
    return Knowledge(covariance, correlations, s, combinations, root, sizes, spread)

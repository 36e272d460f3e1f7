"""The order of the branches of a singular position, which gives them their numbers.

Lines come first, then branches with more freedoms. Lines are compared at one speed of one point:
the faster branch comes first. The others, such as two branches that mirror each other, are ordered
by the projector onto the branch, component by component. Differences up to rounding do not count,
so a branch has the same number at every start in the same position.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cmp_to_key

import numpy as np

from alf_ros.arrays import Floats

_SAME = 1e-6  # part by which numbers of two branches differ at least


def order(bases: Sequence[Floats], speeds: Sequence[float], drifts: Sequence[Floats]) -> list[int]:
    """The branches (indices) in their order.

    bases: of each, directions (dimension, blocks D); speeds: of each at a common scale, 0 of those
    that are no lines; drifts: of each (blocks D).
    """
    fingerprints = [_fingerprint(*each) for each in zip(bases, drifts, strict=True)]

    def compare(a: int, b: int) -> int:
        if len(bases[a]) != len(bases[b]):
            return len(bases[a]) - len(bases[b])
        numbers = zip([speeds[a], *fingerprints[a]], [speeds[b], *fingerprints[b]], strict=True)
        for one, other in numbers:
            if abs(one - other) > _SAME * max(1.0, abs(one), abs(other)):
                return -1 if one > other else 1
        return a - b

    return sorted(range(len(bases)), key=cmp_to_key(compare))


def _fingerprint(basis: Floats, drift: Floats) -> list[float]:
    """Numbers of a subspace, which do not depend on its basis, and of a drift."""
    Q = np.linalg.qr(basis.T)[0].T
    diagonal = np.sum(Q * Q, axis=0)
    first = int(np.argmax(diagonal > diagonal.max(initial=0.0) - _SAME)) if len(Q) else 0
    row = Q[:, first] @ Q
    size = np.abs(drift).max(initial=0.0)
    return [*diagonal.tolist(), *row.tolist(), *(drift / size if size else drift).tolist()]

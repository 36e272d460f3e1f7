"""A step along a curve of positions that does not end on another curve.

Where two curves cross or nearly meet, a step that is closed onto Φ = 0 may lead from one to the
other, with almost the same tangent. But there Φ_q is nearly singular, and changes by much of
itself: E = Φ_q⁺ ΔΦ_q is large. Rows are quadratic in q and Φ_q is linear, so that two positions d
apart have 0 = Φ_q⁺ ΔΦ = (P + E / 2) d, with P the projection across the tangent.

- While |E| < 1, Φ_q keeps its rank on the straight way from one position to the other.
- The angle between d and the tangent is at most asin(|E| / 2), and the tangents differ by at most
  asin(|E|).
- Two positions with the same part along the tangent, and with E and E', are a δ apart with
  δ = -(E + E') δ / 2. With |E| + |E'| < 2 they are one.

So a step is a part of the distance to a singular position ahead. Towards a crossing steps become
shorter without end; where curves come near each other, they become as short as the gap.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.dense_linearisation import Linearised

SINGULAR = 2e-6  # singular value, of its usual one, from which down a position is a singular one
BESIDE = 1e-4  # and from which down it is beside one, where rounding turns the tangent
SAME = 1.0  # change of Φ_q, as a part of itself, below which two positions are on one curve
_CHANGE = 0.25  # and that of a step
_AHEAD = 0.9  # of that, what a step aims at
_SHORTEST = 1e-7  # of the longest step


def sure_step(at: Linearised, t: Floats, longest: float, rank: int) -> Linearised | None:
    """The position a step along a tangent t (n,), of length 1, or None if none is found.

    longest: step, m; rank: of Φ_q along the curve.
    """
    n, h = at.model.n, longest
    q = at.q.copy()
    q[:n] += h * t
    # this change is in proportion to the step
    h *= min(1.0, _AHEAD * _CHANGE / max(change(at, Linearised(at.model, q), rank), 1e-300))
    while h >= _SHORTEST * longest:
        ahead = at.closed(h * t, rank)
        if ahead is not None and change(at, ahead, rank) <= _CHANGE:
            gone = ahead.q[:n] - at.q[:n]
            if gone @ t > 0.5 * h:
                return ahead
        h *= 0.5
    return None


def change(at: Linearised, there: Linearised, rank: int) -> float:
    """|Φ_q⁺ ΔΦ_q| between two positions: by how much Φ_q changes, as a part of itself."""
    part = at.across(there.jacobian - at.jacobian, rank)
    return float(np.linalg.svd(part, compute_uv=False).max(initial=0.0))

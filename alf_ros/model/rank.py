"""Rank of Φ_q and the distance to a singular position, from the factor of A."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel import Work, mass_trace
from alf_ros.model.compile import Model


def effective_rank(model: Model, work: Work) -> float:
    """n - tr(M A⁻¹) with the factor in `work`: the rank of Φ_q, not rounded."""
    return model.n - mass_trace(
        model.unit,
        model.system.pattern,
        work.diagonal,
        work.off,
        work.column,
        np.empty_like(work.diagonal),
        np.empty_like(work.off),
    )


def distance(missing: Floats | float, penalty: Floats | float) -> Floats:
    """About the least singular value of the scaled Φ_q: 0 in a singular position, 1 far away.

    `missing`: by how much the effective rank is less than the number of independent rows, which is
    Σ 1 / (1 + penalty σ²) over their singular values σ. Where several are small it is less than
    each of them. Above about 0.3 only its order of magnitude means something.
    """
    lost = np.clip(missing, 1e-300, 1.0)
    return np.asarray(np.minimum(1.0, np.sqrt((1.0 / lost - 1.0) / penalty)))

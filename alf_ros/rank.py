"""Rank of Φ_q from the factor of A, in the time of another factorisation.

With s_k the singular values of α^½ Φ_q M^-½, n - tr(M A⁻¹) = Σ s_k² / (1 + s_k²): each
independent row counts one, every dependent one nothing, and a row about to become dependent
counts in between, at the scale at which the multipliers of the step feel it too.
"""

from __future__ import annotations

from alf_ros import kernel
from alf_ros.kernel import Work
from alf_ros.model import Model


def effective_rank(model: Model, work: Work) -> float:
    """n - tr(M A⁻¹) with the factor in `work`: the rank of Φ_q, not rounded."""
    return model.n - kernel.mass_trace(model.unit, model.system.pattern, work)

"""How large the penalty of a mechanism is.

The motion does not depend on it, but how many rounds a solve takes does: each leaves 1 / (penalty
σ²) of a mode, and of rounding ε penalty.
"""

from __future__ import annotations

from alf_ros.kernel.data import EPS
from alf_ros.model.compile import Model

LEAST_PENALTY = 1e6
_SOFT = 0.05  # σ of the softest mode, from which on both matter, as in long chains
_STIFFEST = 1e12


def fitted(model: Model, sigma: float) -> Model:
    """The model with a penalty that fits the least singular value σ of its ordinary positions, for
    alf2: that with which both are as large, if it is soft and its own penalty is smaller."""
    penalty = penalty_of(model.penalty, sigma)
    return model if penalty == model.penalty else model.with_penalty(penalty)


def penalty_of(penalty: float, sigma: float) -> float:
    """The penalty of such a model, whose own is `penalty`."""
    return penalty if sigma >= _SOFT else max(penalty, min(EPS**-0.5 / sigma, _STIFFEST))

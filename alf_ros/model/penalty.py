"""How large the penalty of a mechanism is.

The motion does not depend on it, but how many rounds a solve takes does: each leaves a part
1 / (penalty σ²) of a mode, and of a free motion what rounding leaves: about ε penalty, and more of
light parts.
"""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Work
from alf_ros.kernel.data import EPS
from alf_ros.kernel.solve_rounding import ASIDE, solve_rounding
from alf_ros.model.compile import Model
from alf_ros.model.constraints.carried_masses import are_small_and_light
from alf_ros.model.massless_directions import bodies_too_light, no_mass
from alf_ros.model.rank import effective_rank

LEAST_PENALTY = 1e6
HIDDEN = 0.5  # part of a free motion that rounding leaves, from which on it hides the motion
_SOFT = 0.05  # σ of the softest mode, from which on both matter, as in long chains
_STIFFEST = 1e12
_LIGHT = 30.0  # times ε penalty: what rounding leaves of heavy parts, at most
_ROUNDED = 3e-6  # part of a free motion that rounding may leave
_LOOSE = 0.1  # of a mode, at most: with more no round holds it
_SHARP = 1e3  # penalty σ², at least: less would make all modes slow


def fitted(model: Model, ordinary: Floats, work: Work, dependent_rows: int) -> Model:
    """The model with the penalty for alf2.

    It fits the least singular value σ of ordinary positions, which the model knows, and what
    rounding leaves in such a position, `ordinary` (blocks D, m). `work`: memory for its rows.
    Raises AssemblyError if rounding hides a motion with every penalty.
    """
    sigma = model.system.ordinary
    penalty = stiff_penalty(model.penalty, sigma)
    stiff = model if penalty == model.penalty else model.with_penalty(penalty)
    aside = 0.0 if dependent_rows else ASIDE
    part = solve_rounding(model.unit, stiff.system, work, ordinary, aside)
    before, penalty = stiff.penalty, light_penalty(stiff.penalty, sigma, part)
    fit = stiff if penalty == stiff.penalty else stiff.with_penalty(penalty)
    if part >= HIDDEN:
        before, part = penalty, solve_rounding(model.unit, fit.system, work, ordinary, aside)
    if _is_hidden(fit, ordinary, work, part):
        raise no_mass(fit, ordinary)
    if part == np.inf:  # there is no factor aside, but one in that position
        part = 0.0
    return fit.rounded(rounding_of(penalty, before, part))


def _is_hidden(model: Model, q: Floats, work: Work, part: float) -> bool:
    """Whether a light part moves, or holds a heavy one, by less than rounding leaves."""
    light = are_small_and_light(model.unit, model.system)
    if not light and part < HIDDEN:
        return False
    if not kernel.linearise(model.unit, model.system, work, q):
        return True
    loose = model.system.rank - effective_rank(model, work) > _LOOSE
    return light and (loose or HIDDEN <= part < np.inf) and bool(bodies_too_light(model, q))


def stiff_penalty(penalty: float, sigma: float) -> float:
    """The penalty of a model of own `penalty`: if it is soft at least that with which modes and
    heavy parts leave as much."""
    return penalty if sigma >= _SOFT else max(penalty, min(EPS**-0.5 / sigma, _STIFFEST))


def light_penalty(penalty: float, sigma: float, part: float) -> float:
    """The penalty instead, of a model of which rounding leaves this `part`: of light parts as
    little as of heavy ones."""
    if part <= max(_ROUNDED, _LIGHT * EPS * penalty):
        return penalty
    return min(penalty, max(penalty * _ROUNDED / part, _SHARP / sigma**2))


def rounding_of(penalty: float, before: float, part: float) -> float:
    """`System.rounding` with the penalty, if it is this `part` with the one `before`."""
    return max(EPS * penalty, part * penalty / before)

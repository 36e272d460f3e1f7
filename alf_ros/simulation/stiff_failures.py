"""Steps that fail because an effect is too stiff for them: which effect, and the step that does.

Beyond the stability limit of an explicit method the motion grows from stage to stage, until the
loops are torn apart or the numbers overflow. The constraints that fail then are not the fault.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from alf_ros.errors import AlfError
from alf_ros.kernel import Status
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.simulation.dynamics import Dynamics
from alf_ros.simulation.stiffness import Mode, stiffest

IMPLICIT = 'esdirk43_adaptive'
_LOOKED_AT = 600  # coordinates of mechanisms that are examined, with dense matrices
_SAFE = 0.8  # of the limit at one instant, as it changes with the position
_PARTS = 1e-3  # of the grid: steps of an adaptive method that stability makes too many
# where a motion grew the speed is large, so that dry friction at rest is no reason
_GROWN = (Status.NOT_CLOSED, Status.NOT_FINITE)
_RESOLVED = (Status.TOO_LONG, Status.TOO_MANY)


def explained(
    status: Status, sample: Dynamics, integrator: str, h: float
) -> tuple[str, str] | None:
    """(reason, remedy) for a step of h (s) that failed from `sample`, if an effect of the scene
    is too stiff there for the explicit method; None if that is not the cause."""
    if TABLEAUX[integrator].implicit or sample.model.n > _LOOKED_AT:
        return None
    adaptive = TABLEAUX[integrator].embedded.size > 0
    if status not in _GROWN + _RESOLVED or adaptive != (status == Status.TOO_MANY):
        return None
    try:
        alone, whole = stiffest([sample], at_rest=status in _RESOLVED)
    except (AlfError, np.linalg.LinAlgError):
        return None
    limit = whole.step(integrator)
    if not limit < (_PARTS * h if adaptive else h):
        return None
    cause, remedy = told(alone, whole, integrator), f'take the integrator {IMPLICIT}'
    if adaptive:
        return f'{status.reason} because of {cause}', f'{remedy}, or a smaller step'
    shorter = f'or a step of {rounded(_SAFE * limit)} s or less'
    return f'the step is too long for {cause}', f'{remedy}, {shorter}'


def told(alone: Mapping[str, Mode], whole: Mode, integrator: str) -> str:
    """The stiffest effect with its rate, and the step with which the method is stable for all."""
    label, mode = max(alone.items(), key=lambda each: each[1].rate)
    among = '' if mode.rate > 0.9 * whole.rate else f' ({whole.rate:.3g} 1/s with all effects)'
    limit = rounded(whole.step(integrator))
    method = integrator.removesuffix('_adaptive')
    return (
        f'the stiff effect {label}, which changes motions at {mode.rate:.3g} 1/s{among}: '
        f'{method} is stable up to steps of {limit} s'
    )


def rounded(step: float) -> str:
    """A step (s) with two digits, rounded down."""
    if not 0.0 < step < math.inf:
        return f'{step:g}'
    unit = 10.0 ** (math.floor(math.log10(step)) - 1)
    return f'{math.floor(step / unit) * unit:.2g}'

"""Laws of effects that give no finite number, such as a root of a number that fell below zero."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from alf_ros.errors import AlfError
from alf_ros.kernel import Status
from alf_ros.simulation.dynamics import Dynamics

# how a step ends at such a law: adaptive and implicit steps try shorter ones first
SHOWN_BY = (Status.NOT_FINITE, Status.NOT_SETTLED, Status.COLLAPSED, Status.TOO_MANY)
_REMEDY = 'look at its law there, or take a smaller step or smaller forces'


def explained(samples: Iterable[Dynamics]) -> tuple[str, str] | None:
    """(reason, remedy) if the force of an effect is not finite in one of the samples."""
    try:
        for sample in samples:
            for label, Q in sample.forces_by_effect():
                if not np.isfinite(Q).all():
                    return f'the force of {label} is not finite', _REMEDY
    except AlfError:
        pass  # friction has no balance there: the step says how it failed
    return None

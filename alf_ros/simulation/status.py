"""Why a step failed, and what to do about it."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model import assembly
from alf_ros.model.compile import Model
from alf_ros.model.prescribed import prescribe

_PARTS, _HALVINGS = 64, 24  # of a step, in which it is looked for where drives lead

FAILURES: dict[int, tuple[str, str]] = {
    kernel.NOT_POSITIVE: (
        'the leading matrix is not positive definite',
        'a direction has neither mass nor constraint there: give it mass, or check the drawing',
    ),
    kernel.NOT_FINITE: ('the state is no longer finite', 'take a smaller step or smaller forces'),
    kernel.COLLAPSED: (
        'no step is small enough for the tolerance',
        'ask for a larger tolerance, or look for a force that jumps',
    ),
    kernel.JAMMED: (
        "Painlevé's paradox: no balance of friction and the reactions it depends on goes on from "
        'that of the motion, the mechanism jams',
        'take a shorter step, smaller coefficients or a larger slip speed, or give the load as a '
        'number',
    ),
    kernel.TOO_MANY: (
        'the tolerance takes more than 20000 steps within one',
        'take a smaller step, soften the stiffest force, or take the integrator esdirk43_adaptive',
    ),
    kernel.TOO_LONG: (
        'the steps are far too long: their errors are larger than the mechanism',
        'take a smaller step, or an adaptive integrator',
    ),
    kernel.NOT_SETTLED: (
        'the stages of the implicit method find no balance of forces',
        'look for a force that jumps, or take a larger tolerance',
    ),
    kernel.NOT_CLOSED: (
        'the loops cannot be closed within the step',
        'take a smaller step or smaller forces: the mechanism moves too far in one, or a drive '
        'goes where the loops do not reach',
    ),
}


def beyond_reach(model: Model, q: Floats, t: float, h: float) -> tuple[str, str] | None:
    """Whether drives go where the loops do not reach, in the step of h (s) from q (blocks D, m)
    at t (s): the reason and the remedy, or None.

    Loops are closed for their own sake, without forces: so it is said alike of every method.
    """
    if not model.mechanism.drives:
        return None
    good, closed = 0.0, np.array(q)
    for part in range(1, _PARTS + 1):
        s = part * h / _PARTS
        found, said = _followed(model, closed, t + s)
        if found is not None:
            good, closed = s, found
            continue
        bad = s
        for _ in range(_HALVINGS):
            middle = 0.5 * (good + bad)
            found, _ = _followed(model, closed, t + middle)
            if found is None:
                bad = middle
            else:
                good, closed = middle, found
        return (
            f'drives go beyond the reach of the loops at t = {t + good:.6g} s: {said}',
            'take motions that the loops can follow',
        )
    return None


def _followed(model: Model, q: Floats, t: float) -> tuple[Floats | None, str]:
    """The position near q where drives are at t (s); None, and what stays open, without one."""
    start, unused = np.array(q), np.zeros_like(q)
    prescribe(model.system, t, start, unused, unused)
    try:
        return assembly.close(model, {}, start), ''
    except AssemblyError as error:
        return None, error.message.removeprefix('the mechanism cannot be closed: ')

"""Why a step failed, and what to do about it."""

from __future__ import annotations

from alf_ros import kernel

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
        'friction finds no balance with the reactions it depends on: the mechanism jams',
        'take smaller coefficients, a larger slip speed, or give the load as a number',
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

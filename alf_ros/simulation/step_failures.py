"""Why a step failed, and the remedy."""

from __future__ import annotations

from alf_ros.effects.contract import Effect
from alf_ros.errors import AssemblyError, StepError
from alf_ros.kernel import Status
from alf_ros.model.far_places import nearer
from alf_ros.model.singular_branches import position
from alf_ros.model.yielding import yielding, yields
from alf_ros.simulation import force_failures, locked_rows, stiff_failures
from alf_ros.simulation.drive_failures import beyond_reach
from alf_ros.simulation.present import Present
from alf_ros.simulation.stepping import Stepper

_UNDATED = 'a force jumps at an instant, and derivatives end there, as the instant may be moved'
# what rounding of places far from the origin may cause
_FROM_AFAR = Status.NOT_CLOSED, Status.TOO_MANY, Status.COLLAPSED
_DATE = 'give such instants in `Packed.instants`, or run it without derivatives'


def failure(stepper: Stepper, status: Status, present: Present) -> StepError:
    """The exception for a failed step from the present. If the step was stopped, raises the
    exception that stopped it."""
    if status == Status.STOPPED:
        stepper.listener.answer()
    t = present.step * stepper.h
    if status == Status.DRIVE_JUMPS:
        return StepError(f'{stepper.drive_jump}, which takes an infinite force', status.remedy, t)
    if status == Status.FORCE_JUMPS:
        return StepError(*_jump(stepper, present), t)
    found = beyond_reach(stepper.model, present.phase.q, t, stepper.h)
    if found is None and stepper.formulation:
        found = stepper.formulation.failure(status)
    if found is not None:
        return StepError(*found, t)
    if status in force_failures.SHOWN_BY:
        found = _endless(stepper, present)
    if found is None and stepper.formulation is None:
        found = _too_stiff(stepper, status, present)
    if found is not None:
        return StepError(*found, t)
    reason, remedy = told(stepper, status)
    if status == Status.JAMMED:
        reason += f', at t = {present.applied.assembled.bearings.ended[0]:.9g} s'
    if status == Status.NOT_CLOSED:
        crossing, phase = float(stepper.work.crossing[1]), present.phase
        cause = locked_rows.explained(stepper.model, phase.q)
        cause = cause or _yielding(stepper, present)
        cause = cause or stepper.missed.explained(crossing, phase.q, phase.qd)
        if cause is not None:
            reason, remedy = reason + cause[0], cause[1]
    if status == Status.TOO_LONG:
        longest = stepper.resolution_later()().adequate
        remedy = f'take a smaller step, {longest:g} s or less, or an adaptive integrator'
    if status in _FROM_AFAR and (place := nearer(stepper.model.size, present.phase.q)):
        remedy = f'place {place}; or {remedy}'
    return StepError(reason, remedy, t)


def told(stepper: Stepper, status: Status) -> tuple[str, str]:
    """Reason and remedy of a status."""
    remedy = status.remedy
    if status == Status.UNFOLLOWED and stepper.is_implicit:
        remedy = 'beside a singular position they follow explicit integrators alone'
    return status.reason, remedy


def _jump(stepper: Stepper, present: Present) -> tuple[str, str]:
    """Reason and remedy, where the force of an effect jumps and derivatives end."""
    _, kind, over_time = stepper.divider.tolist()
    labels = ', '.join(each.label for each in _of_kind(present.applied.effects, kind))
    status = Status.FORCE_JUMPS
    reason, remedy = (_UNDATED, _DATE) if over_time else (status.reason, status.remedy)
    return f'{reason}: {labels}', remedy


def _of_kind(effects: tuple[Effect, ...], number: int) -> list[Effect]:
    """The effects of a kind, by its number in the kernel."""
    kind = list(dict.fromkeys(each.kind for each in effects))[number]
    return [each for each in effects if each.kind == kind]


def _too_stiff(stepper: Stepper, status: Status, present: Present) -> tuple[str, str] | None:
    """Reason and remedy, if an effect is too stiff for the step from the present."""
    sample = stepper.sample(present, present.step, present.state())
    return stiff_failures.explained(status, sample, stepper.solver.integrator, stepper.h)


def _yielding(stepper: Stepper, present: Present) -> tuple[str, str] | None:
    """The same, if rows hold some directions to second order only."""
    dependent, t = stepper.start.dependent_rows, present.step * stepper.h
    if not dependent:
        return None
    try:
        here = position(stepper.model, present.phase.q, t)
    except AssemblyError:  # drives cannot move on
        return None
    if not yields(here, dependent):
        return None
    return (
        f': it is shaky wherever it goes, {yielding(here)[1]} may yield, and no finite reactions '
        'hold what pushes them there',
        'balance the forces on them, or leave redundant bodies or joints out',
    )


def _endless(stepper: Stepper, present: Present) -> tuple[str, str] | None:
    """Reason and remedy, if a force is not finite at the present, or where a step would go."""
    here = present.state()
    there = here.moved(here.q + stepper.h * here.qd, here.qd, here.turns)
    states = enumerate((here, there), present.step)
    return force_failures.explained(stepper.sample(present, *each) for each in states)

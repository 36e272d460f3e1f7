"""How a step ended: the results of the kernel and of the formulations, each with its remedy."""

from __future__ import annotations

from enum import IntEnum

_SMALLER = 'take a smaller step, or the formulation alf2'


class Status(IntEnum):
    """A result; `reason` says what happened, `remedy` what to do about it."""

    reason: str
    remedy: str

    def __new__(cls, code: int, reason: str = '', remedy: str = '') -> Status:
        """Make a member; the kernel uses the same number."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.reason = reason
        member.remedy = remedy
        return member

    OK = 0
    NOT_POSITIVE = (
        1,
        'the leading matrix is not positive definite',
        'a direction has neither mass nor constraint there: give it mass, or check the drawing',
    )
    NOT_FINITE = 2, 'the state is no longer finite', 'take a smaller step or smaller forces'
    NOT_CLOSED = (
        3,
        'the loops cannot be closed within the step',
        'take a smaller step or smaller forces: the mechanism moves too far in one, or a drive '
        'goes where the loops do not reach',
    )
    COLLAPSED = (
        4,
        'no step is small enough for the tolerance',
        'ask for a larger tolerance, or look for a force that jumps',
    )
    JAMMED = (
        5,
        "Painlevé's paradox: the balance of friction and reactions has no continuation, "
        'the mechanism jams',
        'take a shorter step, smaller coefficients or a larger slip speed, or give the load as a '
        'number',
    )
    TOO_MANY = (
        6,
        'the tolerance takes more than 20000 steps within one',
        'take a smaller step, or slow down what turns or vibrates fastest; if a force is stiff, '
        'take the integrator esdirk43_adaptive',
    )
    NOT_SETTLED = (
        7,
        'the stages of the implicit method find no balance of forces',
        'look for a force that jumps, or use a larger tolerance',
    )
    TOO_LONG = (
        8,
        'the steps are far too long: their errors are larger than the mechanism',
        'take a smaller step, or an adaptive integrator',
    )
    STOPPED = 9, 'it was stopped', 'continue with the next step'
    UNFOLLOWED = (
        10,
        'the derivatives by parameters (tangents) are not determined there',
        'the motion itself is: run it without tangents, or from another start',
    )
    NO_ROOM = 11, 'a trace is longer than its room', 'give it more'
    DRIVE_JUMPS = (
        12,
        'the rate of a drive jumps in the step, which takes an infinite force',
        'round the corners of its motion, or give it as a table',
    )
    FORCE_JUMPS = (
        13,
        'a force jumps where it comes to another branch, and derivatives end there',
        'give it a law that is continuous, or run it without derivatives',
    )
    # of the formulations besides alf2
    SINGULAR = 20, 'the equations are singular there', 'take the formulation alf2'
    OPENED = 21, 'the constraints have opened', _SMALLER
    FOLDED = (
        22,
        'the mechanism has no position with these independent coordinates',
        'they were chosen at the start and are of no use here: take the formulation alf2',
    )


# for compiled code, which takes a member for an object
OK = int(Status.OK)
NOT_POSITIVE = int(Status.NOT_POSITIVE)
NOT_FINITE = int(Status.NOT_FINITE)
NOT_CLOSED = int(Status.NOT_CLOSED)
COLLAPSED = int(Status.COLLAPSED)
JAMMED = int(Status.JAMMED)
TOO_MANY = int(Status.TOO_MANY)
NOT_SETTLED = int(Status.NOT_SETTLED)
TOO_LONG = int(Status.TOO_LONG)
STOPPED = int(Status.STOPPED)
UNFOLLOWED = int(Status.UNFOLLOWED)
NO_ROOM = int(Status.NO_ROOM)
DRIVE_JUMPS = int(Status.DRIVE_JUMPS)
FORCE_JUMPS = int(Status.FORCE_JUMPS)
SINGULAR = int(Status.SINGULAR)
OPENED = int(Status.OPENED)
FOLDED = int(Status.FOLDED)

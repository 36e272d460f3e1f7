"""The motion of a closing so far: where it leads, and the posture held for a later line.

q is extrapolated with the velocity and the curvature of the last calls, and corrected by Newton's
method: that is the candidate ahead (`loop_closing`). The posture held is the last one away from
positions where branches meet; a line of active values may begin there again.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.branch_change import begin_mode, is_left
from alf_ros.kernel.data.closing import (
    AHEAD,
    CALLS,
    FACTORED,
    SHARP,
    SHARP_BEFORE,
    SHARPEST,
    TAKEN,
    Closing,
)
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, zero
from alf_ros.kernel.posture_newton import (
    LEAP,
    begin_at,
    count,
    put_values,
    read,
    settle,
    sharpness,
)

BELIEVED = 0.5  # of the extrapolated way, the correction
GAP = 1e-3  # of the line, before which the loops end
SAME = 1e-9  # of the size: candidates that are the same
AGREE = 1e-6  # rad or size: an active coordinate and its value, turns counted
AWAY = -5.0  # logarithm of the part of the largest σ so far, from which on a posture is held
_STEADY = 0.3  # of a change of a singular value in a call, the change in the call before


@inner
def _agrees(closing: Closing, turns: Integers) -> bool:
    """Whether the active coordinates at the q in `work` are as wanted, with their turns."""
    read(closing, closing.work.q, turns)
    for n in range(closing.active.size):
        scale = 1.0 if closing.is_angle[n] != 0 else closing.tight.size
        off = abs(closing.values[closing.active[n]] - closing.wanted[n])
        if not off <= AGREE * scale:
            return False
    return True


@inner
def extrapolate(closing: Closing, ratio: float) -> float:
    """Where the motion leads, in `ahead`; returns the way there, m, 0 if it is not believed."""
    n = closing.ahead.size
    for a in range(n):
        closing.ahead[a] = closing.place[a] + ratio * (
            closing.rate[a] + 0.5 * ratio * closing.bend[a]
        )
    way = furthest(closing.ahead, closing.place, n)
    return way if closing.counts[CALLS] >= 2 and way <= LEAP * closing.tight.size else 0.0


@inner
def go_ahead(closing: Closing, exactly: bool) -> bool:
    """The candidate ahead, in `work`; returns whether it is one. `exactly`: as in `settle`."""
    work = closing.work
    copy(closing.q, work.q)
    for a in range(closing.ahead.size):
        work.q[a] = closing.ahead[a]
    put_values(closing, closing.wanted)
    copy(closing.turns, closing.turned)
    begin_at(closing, closing.q)
    if not settle(closing, closing.tight, exactly):
        return False
    count(closing, closing.q, closing.turned)
    return _agrees(closing, closing.turned)


@inner
def take(closing: Closing, q: Floats, turns: Integers) -> None:
    """Make q the posture."""
    copy(q, closing.q)
    copy(turns, closing.turns)


@inner
def learn(closing: Closing, ratio: float, near: bool) -> None:
    """Continue the motion with the posture: the polynomial through the last three. `near`: the
    posture was where the motion led."""
    for a in range(closing.ahead.size):
        bend, c = ratio * ratio * closing.bend[a], closing.q[a] - closing.ahead[a]
        closing.rate[a] = ratio * closing.rate[a] + bend + 1.5 * c
        closing.bend[a] = bend + c
        closing.place[a] = closing.q[a]
    closing.counts[CALLS] = 3 if near else 2


@inner
def take_ahead(closing: Closing, q: Floats, turns: Integers, ratio: float, near: bool) -> None:
    """Make the candidate ahead the posture; `near` as in `learn`."""
    take(closing, q, turns)
    learn(closing, ratio, near)
    zero(closing.stride)
    closing.counts[TAKEN] = AHEAD


@inner
def begin_motion(closing: Closing) -> None:
    """Begin a motion, with the step to the posture."""
    calls, way = closing.counts[CALLS], furthest(closing.q, closing.place, closing.place.size)
    for a in range(closing.ahead.size):
        step = closing.q[a] - closing.place[a]
        closing.rate[a] = step if calls > 0 else 0.0
        closing.bend[a] = 0.0
        closing.place[a] = closing.q[a]
    closing.counts[CALLS] = 2 if calls > 0 else 1
    known = closing.known  # nothing but that the step is one
    known[0], known[1], known[2] = way * way, way * way, 2.0 * way * way


@inner
def hold(closing: Closing, last: bool) -> None:
    """Keep the posture, if it is away from dead points; `last`: Newton's method has ended
    there last."""
    if not last:
        copy(closing.q, closing.work.q)
        closing.counts[FACTORED] = 0
    sharp = sharpness(closing)
    closing.trail[SHARPEST] = max(closing.trail[SHARPEST], sharp)
    closing.trail[SHARP_BEFORE], closing.trail[SHARP] = closing.trail[SHARP], sharp
    if sharp >= closing.trail[SHARPEST] + AWAY:
        copy(closing.q, closing.held)
        copy(closing.turns, closing.held_turns)
        copy(closing.wanted, closing.held_at)


@inner
def back_to_held(closing: Closing) -> None:
    """Let the line of this call begin at the posture held last."""
    copy(closing.held, closing.q)
    copy(closing.held_turns, closing.turns)
    copy(closing.held_at, closing.asked)
    zero(closing.stride)


@inner
def may_pass(closing: Closing, sharp: float) -> bool:
    """Whether the least singular value may have vanished on the way to a posture: it would have
    gone on as in the two calls before. sharp: its logarithm, as of `sharpness`."""
    before = np.exp(closing.trail[SHARP] - sharp)
    fallen = np.exp(closing.trail[SHARP_BEFORE] - sharp) - before
    return not fallen < _STEADY * (1.0 + before)


@inner
def jumps(closing: Closing) -> bool:
    """Whether the posture in `work` is on another branch than the last one."""
    copy(closing.work.q, closing.other)
    begin_mode(closing, closing.q)
    copy(closing.other, closing.work.q)
    closing.counts[FACTORED] = 0  # the factor is of another place
    return is_left(closing)

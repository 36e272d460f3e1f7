"""Closing loops around given joint coordinates, on the branch on which the mechanism moves.

Each active joint coordinate has a row; then Φ(q, x) = 0 determines q by the active values x, up to
branches. Two branches meet in a dead point, where Φ_q loses rank, and there x turns back while the
mechanism continues: x alone does not tell the branch, but the motion does. So each call has two
candidates:

- *ahead*: q is extrapolated with the velocity and the curvature of the motion so far, and
  corrected by Newton's method. A dead point does not exist for the motion, so this candidate lies
  behind it.
- *along*: x moves on a straight line from the last values, in short steps that hold the branch
  where branches cross, see `line_tracking`. This candidate stays on this side of all dead points.

The first one holds if the last two corrections were small parts of the extrapolated way, and the
posture is not beside a position where branches meet. Else the second one is computed as well. The
first one then holds if it is the one nearer to the extrapolated place, and if the branch on the
line ends on the way to it, in a dead point.

Values that the loops cannot reach end in a dead point. A line from there may lead to either
branch, or to none, so the next one begins at the last posture before. The way to the dead point is
a motion through it only if the motion led there. For values with noise see `noisy_closing`.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.branch_doubt import STEADY, is_guess
from alf_ros.kernel.branch_end import leads_past
from alf_ros.kernel.closing_motion import (
    BELIEVED,
    GAP,
    SAME,
    back_to_held,
    begin_motion,
    extrapolate,
    go_ahead,
    hold,
    jumps,
    learn,
    may_pass,
    take,
    take_ahead,
)
from alf_ros.kernel.data.closing import (
    ALONG,
    BEYOND,
    CALLS,
    CORRECTIONS,
    CROSSES,
    GUESS,
    MISSED,
    TAKEN,
    Closing,
)
from alf_ros.kernel.line_tracking import go_along, is_regular, is_sound
from alf_ros.kernel.noisy_closing import close_noisy
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.posture_newton import read, sharpness

_NEAR = 0.1  # of the way, the correction in two calls of a motion that needs no other candidate


@inner
def _go_from_held(closing: Closing, reached: float) -> float:
    """The candidate along the line from the posture held last, if it exists, or else the one in
    `work`, which came so far; returns how far it came."""
    work = closing.work
    if furthest(closing.held, closing.q, closing.ahead.size) == 0.0:
        return reached
    copy(work.q, closing.line)
    copy(closing.turned, closing.line_turns)
    back_to_held(closing)
    if go_along(closing, False) == 1.0:
        return 1.0
    copy(closing.line, work.q)
    copy(closing.line_turns, closing.turned)
    return reached


@inner
def _close_exact(closing: Closing, ratio: float) -> float:
    """The posture from values without noise; returns how far the line came."""
    work, n, size = closing.work, closing.ahead.size, closing.tight.size
    way = extrapolate(closing, ratio)
    ahead = way > 0.0 and go_ahead(closing, False)
    off = furthest(work.q, closing.ahead, n) if ahead else np.inf
    near = ahead and off <= _NEAR * way
    error = max(off, closing.trail[MISSED])
    closing.trail[MISSED] = off
    good = near and closing.counts[CALLS] > 2 and is_sound(closing, closing.ahead)
    good = good and is_regular(closing, closing.place, error)
    if good and not (may_pass(closing, sharpness(closing)) and jumps(closing)):
        take_ahead(closing, work.q, closing.turned, ratio, near)
        hold(closing, True)
        return 1.0
    ahead = ahead and off <= way
    if ahead:
        copy(work.q, closing.other)
        copy(closing.turned, closing.other_turns)
    if closing.counts[TAKEN] == BEYOND:
        back_to_held(closing)
    reached = go_along(closing, ahead)
    if ahead and reached < 1.0 - GAP and closing.active.size == 1:
        reached = go_along(closing, False)
        ahead = reached >= 1.0 - GAP  # else behind a gap: one freedom has no way round
    same = ahead and furthest(work.q, closing.other, n) <= SAME * size
    crossing = closing.trail[CROSSES] > 0.0
    beside = furthest(work.q, closing.ahead, n) if ahead else np.inf
    told = crossing
    if ahead and (reached < 1.0 or (off < beside and not (same or crossing))):
        copy(work.q, closing.line)
        copy(closing.turned, closing.line_turns)
        if reached < 1.0 or not leads_past(closing):
            if reached == 1.0 and off > STEADY * way:  # a dead point is passed, on a guess
                closing.counts[GUESS] = 1
            take_ahead(closing, closing.other, closing.other_turns, ratio, near)
            hold(closing, False)
            return 1.0
        copy(closing.line, work.q)
        copy(closing.line_turns, closing.turned)
        told = True  # no dead point is near
    if reached < 1.0:
        reached = _go_from_held(closing, reached)
    if reached == 1.0 and not told and is_guess(closing, way):
        closing.counts[GUESS] = 1
    take(closing, work.q, closing.turned)
    if reached == 1.0:
        hold(closing, False)
    if ahead and reached == 1.0 and beside <= BELIEVED * way:
        learn(closing, ratio, near)
    else:
        if reached < 1.0 and not furthest(closing.q, closing.ahead, n) <= STEADY * way:
            closing.counts[CALLS] = 0  # no motion led here: the values ended on the way
        begin_motion(closing)
    for k in range(closing.wanted.size):
        closing.stride[k] = closing.wanted[k] - closing.asked[k] if reached == 1.0 else 0.0
    closing.counts[TAKEN] = ALONG if reached == 1.0 else BEYOND
    return reached


@compiled
def close_loops(closing: Closing, ratio: float) -> float:
    """The posture at the `wanted` values, in `closing`; returns how far the line came, 1 if there.

    If it is less, the posture is where the line of active values leaves what the loops can reach.
    ratio: the time since the last call over the time between the last two.
    """
    closing.counts[CORRECTIONS] = 0
    reached, noisy = 1.0, largest(closing.noise, closing.noise.size) > 0.0
    if not noisy or not close_noisy(closing, ratio):
        if noisy and furthest(closing.held, closing.q, closing.ahead.size) > 0.0:
            closing.counts[TAKEN] = BEYOND  # beside such a position noise tells no branch
        reached = _close_exact(closing, ratio)
    zero(closing.work.qd)
    read(closing, closing.q, closing.turns)
    for k in range(closing.wanted.size):
        closing.asked[k] = closing.values[closing.active[k]]
        if reached == 1.0 and not noisy:
            closing.asked[k] = closing.wanted[k]
    return reached


@compiled
def close_table(closing: Closing, table: Floats, values: Floats, missed: Floats) -> None:
    """`close_loops` for each row of a table of active values (calls, active), equally spaced.

    values: of all joint coordinates (calls, joint coordinates). missed: (calls,) how far the
    active ones are from the row, rad or m. All are flat.
    """
    active, joints = closing.active.size, closing.values.size
    for call in range(missed.size):
        for k in range(active):
            closing.wanted[k] = table[call * active + k]
        close_loops(closing, 1.0)
        most = 0.0
        for k in range(active):
            off = closing.values[closing.active[k]] - closing.wanted[k]
            most = max(most, abs(off))
        missed[call] = most
        for k in range(joints):
            values[call * joints + k] = closing.values[k]

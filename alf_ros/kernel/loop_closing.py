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
branch, or to none, so the next one begins at the last posture before. Values with noise do not
determine q near a dead point: there the motion is an estimate, see `_close_noisy`. It may leave
the branch where another one passes it closely: `_strays` compares it with the line.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.branch_change import begin_mode, is_left
from alf_ros.kernel.branch_doubt import STEADY, is_guess, is_unsure
from alf_ros.kernel.data import EPS, NOTHING
from alf_ros.kernel.data.closing import Closing
from alf_ros.kernel.line_tracking import go_along, is_regular, is_sound, leads_past
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.posture_newton import (
    LEAP,
    begin_at,
    count,
    put_values,
    read,
    settle,
    sharpness,
)

_BELIEVED = 0.5  # of the extrapolated way, the correction
_NEAR = 0.1  # the same, for two calls, of a motion that needs no other candidate
_STEADY = 0.3  # of a change of a singular value in a call, the change in the call before
_SAME = 1e-9  # of the size: candidates that are the same
_GAP = 1e-3  # of the line, before which the loops end
_AWAY = -5.0  # logarithm of the part of the largest σ so far, from which on a posture is held
_SOFT = -2.0  # the same, below which a branch may be left
_AGREE = 1e-6  # rad or size: an active coordinate and its value, turns counted

_FITS = 5.0  # standard deviations, up to which a value fits the motion
_UNSURE = 0.03  # of the way: standard deviation of the change of velocity in a call
_HIDDEN = 10.0  # standard deviations: a narrower bend of a branch is hidden in the noise

AHEAD, ALONG, BEYOND = 0, 1, 2  # which candidate a call took; the last: as far as the line reaches


@inner
def _agrees(closing: Closing, turns: Integers) -> bool:
    """Whether the active coordinates at the q in `work` are as wanted, with their turns."""
    read(closing, closing.work.q, turns)
    for n in range(closing.active.size):
        scale = 1.0 if closing.is_angle[n] != 0 else closing.tight.size
        off = abs(closing.values[closing.active[n]] - closing.wanted[n])
        if not off <= _AGREE * scale:
            return False
    return True


@inner
def _extrapolate(closing: Closing, ratio: float) -> float:
    """Where the motion leads, in `ahead`; returns the way there, m, 0 if it is not believed."""
    n = closing.ahead.size
    for a in range(n):
        closing.ahead[a] = closing.place[a] + ratio * (
            closing.rate[a] + 0.5 * ratio * closing.bend[a]
        )
    way = furthest(closing.ahead, closing.place, n)
    return way if closing.counts[0] >= 2 and way <= LEAP * closing.tight.size else 0.0


@inner
def _go_ahead(closing: Closing, exactly: bool) -> bool:
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
def _onto_loops(closing: Closing) -> float:
    """Move `ahead` to where the loops are closed; returns how far the active coordinates are from
    `wanted` there, in standard deviations; inf if the loops cannot be closed."""
    work = closing.work
    copy(closing.q, work.q)
    for a in range(closing.ahead.size):
        work.q[a] = closing.ahead[a]
    copy(closing.turns, closing.turned)
    begin_at(closing, closing.q)
    if not settle(closing, closing.loose, False):
        return np.inf
    for a in range(closing.ahead.size):
        closing.shift[a] = work.q[a] - closing.ahead[a]
        closing.ahead[a] = work.q[a]
    count(closing, closing.q, closing.turned)
    return _deviations(closing, closing.turned)


@inner
def _deviations(closing: Closing, turns: Integers) -> float:
    """The largest difference of the active coordinates at the q in `work` from `wanted`, in
    standard deviations."""
    read(closing, closing.work.q, turns)
    most = 0.0
    for n in range(closing.active.size):
        off = abs(closing.values[closing.active[n]] - closing.wanted[n])
        most = max(most, off / (closing.noise[n] + _AGREE * EPS))
    return most


@inner
def _put_reached(closing: Closing) -> None:
    """The active values of the q in `work`: their rows are closed there, as the loops are."""
    read(closing, closing.work.q, closing.turned)
    for k in range(closing.active.size):
        closing.here[k] = closing.values[closing.active[k]]
    put_values(closing, closing.here)


@inner
def _take(closing: Closing, q: Floats, turns: Integers) -> None:
    """Make q the posture."""
    copy(q, closing.q)
    copy(turns, closing.turns)


@inner
def _learn(closing: Closing, ratio: float, near: bool) -> None:
    """Continue the motion with the posture: the polynomial through the last three. `near`: the
    posture was where the motion led."""
    for a in range(closing.ahead.size):
        bend, c = ratio * ratio * closing.bend[a], closing.q[a] - closing.ahead[a]
        closing.rate[a] = ratio * closing.rate[a] + bend + 1.5 * c
        closing.bend[a] = bend + c
        closing.place[a] = closing.q[a]
    closing.counts[0] = 3 if near else 2


@inner
def _take_ahead(closing: Closing, q: Floats, turns: Integers, ratio: float, near: bool) -> None:
    """Make the candidate ahead the posture; `near` as in `_learn`."""
    _take(closing, q, turns)
    _learn(closing, ratio, near)
    zero(closing.stride)
    closing.counts[2] = AHEAD


@inner
def _begin(closing: Closing) -> None:
    """Begin a motion, with the step to the posture."""
    calls, way = closing.counts[0], furthest(closing.q, closing.place, closing.place.size)
    for a in range(closing.ahead.size):
        step = closing.q[a] - closing.place[a]
        closing.rate[a] = step if calls > 0 else 0.0
        closing.bend[a] = 0.0
        closing.place[a] = closing.q[a]
    closing.counts[0] = 2 if calls > 0 else 1
    known = closing.known  # nothing but that the step is one
    known[0], known[1], known[2] = way * way, way * way, 2.0 * way * way


@inner
def _hold(closing: Closing, last: bool) -> None:
    """Keep the posture, if it is away from dead points; `last`: Newton's method has ended
    there last."""
    if not last:
        copy(closing.q, closing.work.q)
        closing.counts[3] = 0
    sharp = sharpness(closing)
    closing.trail[1] = max(closing.trail[1], sharp)
    closing.trail[4], closing.trail[3] = closing.trail[3], sharp
    if sharp >= closing.trail[1] + _AWAY:
        copy(closing.q, closing.held)
        copy(closing.turns, closing.held_turns)
        copy(closing.wanted, closing.held_at)


@inner
def _back_to_held(closing: Closing) -> None:
    """Let the line of this call begin at the posture held last."""
    copy(closing.held, closing.q)
    copy(closing.held_turns, closing.turns)
    copy(closing.held_at, closing.asked)
    zero(closing.stride)


@inner
def _go_from_held(closing: Closing, reached: float) -> float:
    """The candidate along the line from the posture held last, if it exists, or else the one in
    `work`, which came so far; returns how far it came."""
    work = closing.work
    if furthest(closing.held, closing.q, closing.ahead.size) == 0.0:
        return reached
    copy(work.q, closing.line)
    copy(closing.turned, closing.line_turns)
    _back_to_held(closing)
    if go_along(closing, False) == 1.0:
        return 1.0
    copy(closing.line, work.q)
    copy(closing.line_turns, closing.turned)
    return reached


@inner
def _may_pass(closing: Closing, sharp: float) -> bool:
    """Whether the least singular value may have vanished on the way to a posture: it would have
    gone on as in the two calls before. sharp: its logarithm, as of `sharpness`."""
    before = np.exp(closing.trail[3] - sharp)
    fallen = np.exp(closing.trail[4] - sharp) - before
    return not fallen < _STEADY * (1.0 + before)


@inner
def _jumps(closing: Closing) -> bool:
    """Whether the posture in `work` is on another branch than the last one."""
    copy(closing.work.q, closing.other)
    begin_mode(closing, closing.q)
    copy(closing.other, closing.work.q)
    closing.counts[3] = 0  # the factor is of another place
    return is_left(closing)


@inner
def _is_doubtful(closing: Closing) -> bool:
    """Whether the posture in `work` may be on another branch than the last ones: its mode shows
    it, or it is the first one away from a position where branches meet."""
    sharp = sharpness(closing)
    if furthest(closing.held, closing.q, closing.ahead.size) > 0.0:
        return sharp >= closing.trail[1] + _AWAY
    passes = _may_pass(closing, sharp)
    if passes and closing.active.size == 1:  # over a gap the mode may come back
        return True
    soft = min(sharp, closing.trail[3]) < closing.trail[1] + _SOFT
    return (soft or passes) and _jumps(closing)


@inner
def _is_hidden(closing: Closing, sharp: float) -> bool:
    """Whether a bend of the branch, which the last line went around, is hidden in the noise.
    sharp: at its end.

    The least singular value is k √(x² + w²), x from a bend of half the width w, so its least value
    on the line shows w.
    """
    part = np.exp(closing.trail[5] - sharp)
    for k in range(closing.wanted.size):
        if part * abs(closing.wanted[k] - closing.asked[k]) > _HIDDEN * closing.noise[k]:
            return False
    return True


@inner
def _strays(closing: Closing) -> bool:
    """Whether the posture in `work`, where the motion leads, is on another branch than the last
    posture away from where branches meet. Then the one in `work` is on that branch.

    As with exact values: the motion may pass a dead point, but nothing else. Where the branch ends
    before the values, and one active joint has no way round, nobody knows it behind the gap.
    """
    work, n = closing.work, closing.ahead.size
    copy(work.q, closing.other)
    copy(closing.turned, closing.other_turns)
    _back_to_held(closing)
    reached = go_along(closing, False)
    if reached < 1.0 - _GAP and closing.active.size == 1:
        closing.counts[4] = 1
    same = furthest(work.q, closing.other, n) <= _SAME * closing.tight.size
    if reached == 1.0 and not same:
        copy(work.q, closing.line)
        copy(closing.turned, closing.line_turns)
        closing.counts[3] = 0
        sharp = sharpness(closing)
        hidden = _is_hidden(closing, sharp)
        if leads_past(closing):
            if hidden:
                closing.counts[4] = 1
            copy(closing.line, work.q)
            copy(closing.line_turns, closing.turned)
            closing.counts[3] = 0
            return True
    copy(closing.other, work.q)
    copy(closing.other_turns, closing.turned)
    closing.counts[3] = 0
    return False


@inner
def _close_noisy(closing: Closing, ratio: float) -> bool:
    """The posture from values with noise, if they fit the motion; returns whether they do.

    The motion is estimated by Kalman's filter for one of constant velocity: with Newton's
    correction δ of the extrapolated place, off by e standard deviations, its scale is |δ| and the
    variance of a measurement is (|δ| / e)². Near a dead point this variance is large, so values
    hardly correct the motion there. What closes the loops, d, bends the path: it is known.
    """
    work, n, known = closing.work, closing.ahead.size, closing.known
    way = _extrapolate(closing, ratio)
    if way == 0.0:
        return False
    if is_unsure(closing, way):
        closing.counts[4] = 1
    off = _onto_loops(closing)
    if not off < np.inf:
        return False
    reached = _go_ahead(closing, True)
    changes = _UNSURE * way
    p = changes * changes
    position = known[0] + ratio * (2.0 * known[1] + ratio * known[2]) + 0.25 * p
    both, speed = known[1] + ratio * known[2] + 0.5 * p, known[2] + p
    turned = largest(closing.way, n)
    measured = turned / max(off, EPS)
    total = position + measured * measured + NOTHING
    fits = turned * turned <= _FITS * _FITS * total
    if not (fits or (reached and furthest(work.q, closing.ahead, n) <= _BELIEVED * way)):
        return False
    to_place, to_rate = position / total, both / total
    nearer = reached and (to_place > 0.5 or furthest(work.q, closing.ahead, n) < turned)
    for a in range(n):
        c, d = closing.way[a], closing.shift[a]
        if nearer:  # beside a dead point the first correction of Newton's method goes too far
            c = work.q[a] - closing.ahead[a]
        closing.place[a] = closing.ahead[a] + to_place * c
        closing.rate[a] = ratio * closing.rate[a] + 2.0 * d + to_rate * c
    known[0], known[1] = (1.0 - to_place) * position, (1.0 - to_place) * both
    known[2] = speed - to_rate * both
    if not reached:
        copy(closing.turns, closing.turned)
        if not settle(closing, closing.loose, False):
            return False
        count(closing, closing.q, closing.turned)
        if _deviations(closing, closing.turned) > _FITS:  # Newton's method ended too early
            go_along(closing, False)
        _put_reached(closing)
    strays = reached and _is_doubtful(closing) and _strays(closing)
    _take(closing, work.q, closing.turned)
    if reached:
        _hold(closing, True)
    closing.counts[2] = AHEAD
    if strays:
        closing.counts[0] = 0  # the motion begins anew
        _begin(closing)
    return True


@inner
def _close_exact(closing: Closing, ratio: float) -> float:
    """The posture from values without noise; returns how far the line came."""
    work, n, size = closing.work, closing.ahead.size, closing.tight.size
    way = _extrapolate(closing, ratio)
    ahead = way > 0.0 and _go_ahead(closing, False)
    off = furthest(work.q, closing.ahead, n) if ahead else np.inf
    near = ahead and off <= _NEAR * way
    error = max(off, closing.trail[0])
    closing.trail[0] = off
    good = near and closing.counts[0] > 2 and is_sound(closing, closing.ahead)
    good = good and is_regular(closing, closing.place, error)
    if good and not (_may_pass(closing, sharpness(closing)) and _jumps(closing)):
        _take_ahead(closing, work.q, closing.turned, ratio, near)
        _hold(closing, True)
        return 1.0
    ahead = ahead and off <= way
    if ahead:
        copy(work.q, closing.other)
        copy(closing.turned, closing.other_turns)
    if closing.counts[2] == BEYOND:
        _back_to_held(closing)
    reached = go_along(closing, ahead)
    if ahead and reached < 1.0 - _GAP and closing.active.size == 1:
        reached = go_along(closing, False)
        ahead = reached >= 1.0 - _GAP  # else behind a gap: one freedom has no way round
    same = ahead and furthest(work.q, closing.other, n) <= _SAME * size
    crossing = closing.trail[2] > 0.0
    beside = furthest(work.q, closing.ahead, n) if ahead else np.inf
    told = crossing
    if ahead and (reached < 1.0 or (off < beside and not (same or crossing))):
        copy(work.q, closing.line)
        copy(closing.turned, closing.line_turns)
        if reached < 1.0 or not leads_past(closing):
            if reached == 1.0 and off > STEADY * way:  # a dead point is passed, on a guess
                closing.counts[4] = 1
            _take_ahead(closing, closing.other, closing.other_turns, ratio, near)
            _hold(closing, False)
            return 1.0
        copy(closing.line, work.q)
        copy(closing.line_turns, closing.turned)
        told = True  # no dead point is near
    if reached < 1.0:
        reached = _go_from_held(closing, reached)
    if reached == 1.0 and not told and is_guess(closing, way):
        closing.counts[4] = 1
    _take(closing, work.q, closing.turned)
    if reached == 1.0:
        _hold(closing, False)
    if ahead and reached == 1.0 and beside <= _BELIEVED * way:
        _learn(closing, ratio, near)
    else:
        _begin(closing)
    for k in range(closing.wanted.size):
        closing.stride[k] = closing.wanted[k] - closing.asked[k] if reached == 1.0 else 0.0
    closing.counts[2] = ALONG if reached == 1.0 else BEYOND
    return reached


@compiled
def close_loops(closing: Closing, ratio: float) -> float:
    """The posture at the `wanted` values, in `closing`; returns how far the line came, 1 if there.

    If it is less, the posture is where the line of active values leaves what the loops can reach.
    ratio: the time since the last call over the time between the last two.
    """
    closing.counts[1] = 0
    reached, noisy = 1.0, largest(closing.noise, closing.noise.size) > 0.0
    if not noisy or not _close_noisy(closing, ratio):
        if noisy and furthest(closing.held, closing.q, closing.ahead.size) > 0.0:
            closing.counts[2] = BEYOND  # beside a position where branches meet noise tells none
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

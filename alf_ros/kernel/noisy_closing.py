"""Closing loops around values with noise: the motion is an estimate.

Beside a dead point values with noise do not determine q. There the motion does, which Kalman's
filter estimates (`close_noisy`). It may leave the branch where another one passes it closely:
`_strays` compares it with the line of the active values.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Integers
from alf_ros.kernel.branch_doubt import is_unsure
from alf_ros.kernel.branch_end import leads_past
from alf_ros.kernel.closing_motion import (
    AGREE,
    AWAY,
    BELIEVED,
    GAP,
    SAME,
    back_to_held,
    begin_motion,
    extrapolate,
    go_ahead,
    hold,
    jumps,
    may_pass,
    take,
)
from alf_ros.kernel.data import EPS, NOTHING
from alf_ros.kernel.data.closing import (
    AHEAD,
    CALLS,
    FACTORED,
    GUESS,
    LEAST,
    SHARP,
    SHARPEST,
    TAKEN,
    Closing,
)
from alf_ros.kernel.line_tracking import go_along
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest
from alf_ros.kernel.posture_newton import begin_at, count, put_values, read, settle, sharpness

_SOFT = -2.0  # logarithm of the part of the largest σ so far, below which a branch may be left
_FITS = 5.0  # standard deviations, up to which a value fits the motion
_UNSURE = 0.03  # of the way: standard deviation of the change of velocity in a call
_HIDDEN = 10.0  # standard deviations: a narrower bend of a branch is hidden in the noise


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
        most = max(most, off / (closing.noise[n] + AGREE * EPS))
    return most


@inner
def _put_reached(closing: Closing) -> None:
    """The active values of the q in `work`: their rows are closed there, as the loops are."""
    read(closing, closing.work.q, closing.turned)
    for k in range(closing.active.size):
        closing.here[k] = closing.values[closing.active[k]]
    put_values(closing, closing.here)


@inner
def _is_doubtful(closing: Closing) -> bool:
    """Whether the posture in `work` may be on another branch than the last ones: its mode shows
    it, or it is the first one away from a position where branches meet."""
    sharp = sharpness(closing)
    if furthest(closing.held, closing.q, closing.ahead.size) > 0.0:
        return sharp >= closing.trail[SHARPEST] + AWAY
    passes = may_pass(closing, sharp)
    if passes and closing.active.size == 1:  # over a gap the mode may come back
        return True
    soft = min(sharp, closing.trail[SHARP]) < closing.trail[SHARPEST] + _SOFT
    return (soft or passes) and jumps(closing)


@inner
def _is_hidden(closing: Closing, sharp: float) -> bool:
    """Whether a bend of the branch, which the last line went around, is hidden in the noise.
    sharp: at its end.

    The least singular value is k √(x² + w²), x from a bend of half the width w, so its least value
    on the line shows w.
    """
    part = np.exp(closing.trail[LEAST] - sharp)
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
    back_to_held(closing)
    reached = go_along(closing, False)
    if reached < 1.0 - GAP and closing.active.size == 1:
        closing.counts[GUESS] = 1
    same = furthest(work.q, closing.other, n) <= SAME * closing.tight.size
    if reached == 1.0 and not same:
        copy(work.q, closing.line)
        copy(closing.turned, closing.line_turns)
        closing.counts[FACTORED] = 0
        sharp = sharpness(closing)
        hidden = _is_hidden(closing, sharp)
        if leads_past(closing):
            if hidden:
                closing.counts[GUESS] = 1
            copy(closing.line, work.q)
            copy(closing.line_turns, closing.turned)
            closing.counts[FACTORED] = 0
            return True
    copy(closing.other, work.q)
    copy(closing.other_turns, closing.turned)
    closing.counts[FACTORED] = 0
    return False


@inner
def close_noisy(closing: Closing, ratio: float) -> bool:
    """The posture from values with noise, if they fit the motion; returns whether they do.

    The motion is estimated by Kalman's filter for one of constant velocity: with Newton's
    correction δ of the extrapolated place, off by e standard deviations, its scale is |δ| and the
    variance of a measurement is (|δ| / e)². Near a dead point this variance is large, so values
    hardly correct the motion there. What closes the loops, d, bends the path: it is known.
    """
    work, n, known = closing.work, closing.ahead.size, closing.known
    way = extrapolate(closing, ratio)
    if way == 0.0:
        return False
    if is_unsure(closing, way):
        closing.counts[GUESS] = 1
    off = _onto_loops(closing)
    if not off < np.inf:
        return False
    reached = go_ahead(closing, True)
    changes = _UNSURE * way
    p = changes * changes
    position = known[0] + ratio * (2.0 * known[1] + ratio * known[2]) + 0.25 * p
    both, speed = known[1] + ratio * known[2] + 0.5 * p, known[2] + p
    turned = largest(closing.way, n)
    measured = turned / max(off, EPS)
    total = position + measured * measured + NOTHING
    fits = turned * turned <= _FITS * _FITS * total
    if not (fits or (reached and furthest(work.q, closing.ahead, n) <= BELIEVED * way)):
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
    take(closing, work.q, closing.turned)
    if reached:
        hold(closing, True)
    closing.counts[TAKEN] = AHEAD
    if strays:
        closing.counts[CALLS] = 0  # the motion begins anew
        begin_motion(closing)
    return True

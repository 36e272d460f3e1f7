"""Whether a branch ends between two postures with the same active values, in a dead point.

There both postures are one motion. If the branch does not end, they are on two branches.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import NOTHING
from alf_ros.kernel.data.closing import Closing
from alf_ros.kernel.line_tracking import (
    LONGER,
    PATIENCE,
    SHORTER,
    STALE,
    learn_line,
    take_step,
)
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest
from alf_ros.kernel.posture_newton import begin_at, count, read, settle

_PIECE, _SHORT = 0.2, 1e-3  # of the way between candidates: a step, and the shortest
_BEYOND = 2.0  # times the way to the values half way between them, where the branch would end


@inner
def leads_past(closing: Closing) -> bool:
    """Whether the branch of the candidate in `line` leads past the candidate in `other`: no dead
    point is between them. The derivatives by the line stay, with which the next line may begin."""
    n = closing.ahead.size
    for a in range(n):
        closing.places[a], closing.places[n + a] = closing.slope[a], closing.bow[a]
    past = _leads_on(closing) if closing.active.size == 1 else _leads_over(closing)
    for a in range(n):
        closing.slope[a], closing.bow[a] = closing.places[a], closing.places[n + a]
    return past


@inner
def _leads_on(closing: Closing) -> bool:
    """The same of one active joint: the branch goes further on the line, whose end `line` is,
    towards the other candidate, than that is away. Else it ends half way."""
    work, n = closing.work, closing.ahead.size
    way, speed = furthest(closing.other, closing.line, n), largest(closing.slope, n)
    if speed == 0.0:
        return False
    along = 0.0
    for a in range(n):
        along += closing.slope[a] * (closing.other[a] - closing.line[a])
    copy(closing.line, closing.before)
    copy(closing.line, work.q)
    begin_at(closing, work.q)
    longest = _PIECE * way / speed
    s, last, h = 1.0, 0.0, longest if along > 0.0 else -longest
    for _ in range(PATIENCE):
        known = True
        good = take_step(closing, s, h, True, True)
        # the derivatives at the end of the line are rough if it went around a bend
        if not good and (last == 0.0 or abs(h) < STALE * abs(last)):
            known = False
            good = take_step(closing, s, h, False, True)
        if good:
            learn_line(closing, h, last, known)
            copy(work.q, closing.before)
            s, last = s + h, h
            if furthest(closing.before, closing.line, n) >= way:
                return True
            longest = _PIECE * way / (largest(closing.slope, n) + NOTHING)
            h = np.sign(h) * min(LONGER * abs(h), longest)
        else:
            h *= SHORTER
            if abs(h) * speed < _SHORT * _PIECE * way:
                return False
    return False


@inner
def _leads_over(closing: Closing) -> bool:
    """The same of several active joints, which may go along a singular curve, not to it.

    If a dead point is between the candidates, it is half way, and the values of a posture there
    are beyond the wanted ones by as much as the curve is. So the branch ends on the line to these
    values. Else it leads over them.
    """
    work, n, active = closing.work, closing.ahead.size, closing.active.size
    copy(closing.line, work.q)
    for a in range(n):
        work.q[a] = 0.5 * (closing.line[a] + closing.other[a])
    copy(closing.line_turns, closing.turned)
    begin_at(closing, closing.line)
    if not settle(closing, closing.loose, False):
        return False
    count(closing, closing.line, closing.turned)
    read(closing, work.q, closing.turned)
    for k in range(active):
        closing.ends[k], closing.ends[active + k] = closing.asked[k], closing.wanted[k]
        closing.asked[k] = closing.wanted[k]
        closing.wanted[k] = closing.values[closing.active[k]]
    over = _goes_over(closing)
    for k in range(active):
        closing.asked[k], closing.wanted[k] = closing.ends[k], closing.ends[active + k]
    return over


@inner
def _goes_over(closing: Closing) -> bool:
    """Whether the branch of the candidate in `line` continues beyond the end of the line from the
    `asked` to the `wanted` values, which begins there."""
    work = closing.work
    copy(closing.line, closing.before)
    copy(closing.line_turns, closing.turned)
    begin_at(closing, closing.line)
    s, last, h, known = 0.0, 0.0, _PIECE, False
    for _ in range(PATIENCE):
        by = known and h >= STALE * last
        if take_step(closing, s, h, by, True):
            learn_line(closing, h, last, by)
            copy(work.q, closing.before)
            s, last, known = s + h, h, True
            if s >= _BEYOND:
                return True
            h = min(LONGER * h, _PIECE)
        else:
            h *= SHORTER
            if h < _SHORT * _PIECE:
                return False
    return False

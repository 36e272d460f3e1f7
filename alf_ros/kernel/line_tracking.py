"""A branch along a straight line of active values, held through positions where branches cross.

The line goes from the `asked` values (s = 0) to the `wanted` ones (s = 1). A step extrapolates q
with its first and second derivative by s, and Newton's method corrects it. It holds only if the
correction is a small part of the step, and the first correction is nearly all of it: beside a
position where branches cross, each of the two branches is then far from the place extrapolated on
the other one, and a step does not end so close to the position that they are about the same.

Where two branches nearly cross, both tests may hold for a jump from one to the other. So a step
over which the determinant of Φ_q changes its sign is shortened, see `branch_change`: a branch that
passes the other one is followed around the bend. Steps of `_PASSED` hold: there branches cross.

If the wanted values themselves are so close to the position, the branch is followed over it, and
the posture is interpolated from four places, two on either side; see `_straddle`.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.branch_change import begin_mode, is_left
from alf_ros.kernel.data import EPS, NOTHING
from alf_ros.kernel.data.closing import CROSSES, LEAST, SHARPEST, Closing
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.posture_newton import begin_at, count, put_values, settle, sharpness
from alf_ros.kernel.triangular_solve import solve

_TURN, _MOVE = 0.25, 0.1  # of an active angle (rad), and of a length (size), in a step
_HOP = 0.15  # of the size: longest step of q
_NEAR = 0.1  # of a step, its correction
_BOWED = 0.5  # of the first order of an extrapolation, the second: it would turn back to a branch
_SOUND = 0.2  # of the first correction, the rest of them
_BLUNT = -3.0  # logarithm of a part of the largest σ so far, from which on s is looked at
_FIRM = 1e2  # s² of a mode that A hardly holds back
_MARGIN = 10.0  # times an error of a place, in sizes: σ
_CROSSED = 0.75  # of the mean sharpness of two places: that between them, where branches cross
_TINY = 1e-11  # of the size: a correction that does not count
PATIENCE = 1000  # fine steps: more are taken only where several directions are lost together
_FINE, _FINEST = 1e-5, 1e-12  # of the first step: any convergence is good; at least
_STRETCHED = 1.2  # a step, at most, to end with the line
STALE = 0.1  # of the last step: a step that is so much shorter does without its derivatives
SHORTER, LONGER = 0.4, 1.7  # the next step; powers of these do not meet a place again
_OVER = 0.4  # of a step, how far it goes beyond the wanted values
_CLOSER, _LEVELS = 0.17, 3  # places of `_straddle`, in the next of so many levels
_AGAIN, _TRIES = 0.77, 8  # the same, if one of them is too close to the position; in all
_PASSED = 1e-5  # rad, or of the size: branches that pass each other closer than that cross
_WIDE = 5e-4  # rad, or of the size: for `_straddle`, where they do cross
_CLOSE = 1e-3  # of the size: places so close tell the posture as well as Newton's method
_SKIPS = 4  # of steps of a line: those that do not end where they would be too close to it
_PLACES = (-2.0, -1.0, 1.0, 2.0)


@inner
def is_sound(closing: Closing, start: Floats) -> bool:
    """Whether the first correction from `start` to the q in `work` is nearly all of it."""
    n, rest = closing.ahead.size, 0.0
    for a in range(n):
        rest = max(rest, abs(closing.work.q[a] - start[a] - closing.way[a]))
    return rest <= _SOUND * largest(closing.way, n) + _TINY * closing.tight.size


@inner
def is_regular(closing: Closing, start: Floats, off: float) -> bool:
    """Whether the q in `work` is far enough from a position where branches meet, if the place from
    which Newton's method came is off by so much (m). start: where the motion came from.

    Right in such a position Newton's method moves nothing in one direction, so its corrections
    show nothing. The determinant of A does: it has a factor 1 + s² of each mode. If it
    is small, A⁻¹ shows s: it leaves a part 1 / (1 + s²) of a motion in that mode.
    """
    sharp = sharpness(closing)
    closing.trail[SHARPEST] = max(closing.trail[SHARPEST], sharp)
    closing.trail[LEAST] = min(closing.trail[LEAST], sharp)
    if sharp >= closing.trail[SHARPEST] + _BLUNT:
        return True
    work, n, system = closing.work, closing.ahead.size, closing.tight
    zero(work.delta)
    for a in range(n):
        work.delta[a] = system.mean * (work.q[a] - start[a])
    way = largest(work.delta, n) / system.mean
    solve(closing.unit, system.pattern, work.diagonal, work.off, work.delta)
    square = way / (largest(work.delta, n) + NOTHING)
    return square >= max(_FIRM, system.penalty * (_MARGIN * off / system.size) ** 2)


@inner
def _put_line(closing: Closing, s: float) -> None:
    """The active values at s."""
    for k in range(closing.wanted.size):
        x = closing.asked[k] + s * (closing.wanted[k] - closing.asked[k])
        closing.here[k] = closing.wanted[k] if s == 1.0 else x
    put_values(closing, closing.here)


@inner
def _fit(closing: Closing, h: float, last: float) -> None:
    """Bend the polynomial at `before`, so that it ends at h in the q in `work`, as at -`last`."""
    for a in range(closing.ahead.size):
        c = (closing.work.q[a] - closing.guess[a]) / (h * (h + last))
        closing.slope[a] += c * last
        closing.bow[a] += 2.0 * c


@inner
def take_step(closing: Closing, s: float, h: float, known: bool, exactly: bool) -> bool:
    """A step from `before`, at s, to the q in `work`; `known`: with the derivatives by s."""
    work, n, size = closing.work, closing.ahead.size, closing.tight.size
    copy(closing.before, work.q)
    copy(closing.before, closing.guess)
    if known:
        if 0.5 * abs(h) * largest(closing.bow, n) > _BOWED * largest(closing.slope, n):
            return False
        for a in range(n):
            closing.guess[a] += h * (closing.slope[a] + 0.5 * h * closing.bow[a])
            work.q[a] = closing.guess[a]
        if not furthest(closing.guess, closing.before, n) <= _HOP * size:
            return False
    _put_line(closing, s + h)
    if not settle(closing, closing.tight, exactly) or not is_sound(closing, closing.guess):
        return False
    way = furthest(work.q, closing.before, n)
    off = furthest(work.q, closing.guess, n) if known else 0.0
    return way <= _HOP * size and off <= _NEAR * way + _TINY * size


@inner
def _creep(closing: Closing, s: float, h: float) -> bool:
    """A step that is so short that any convergence is good."""
    work, n = closing.work, closing.ahead.size
    copy(closing.before, work.q)
    copy(closing.before, closing.guess)
    _put_line(closing, s + h)
    if not settle(closing, closing.tight, True):
        return False
    rest = 0.0
    for a in range(n):
        rest = max(rest, abs(work.q[a] - closing.before[a] - closing.way[a]))
    return rest <= 1.01 * largest(closing.way, n) + EPS**0.5 * closing.tight.size


@inner
def _error(closing: Closing, known: bool) -> float:
    """By how much the place was off, from which the last step was corrected, m."""
    off = 0.0
    for a in range(closing.ahead.size):
        first = 0.0 if known else closing.way[a]
        off = max(off, abs(closing.work.q[a] - closing.guess[a] - first))
    return off


@inner
def learn_line(closing: Closing, h: float, last: float, known: bool) -> None:
    """The derivatives by s at the end of a step h, the one before it was `last`."""
    n = closing.ahead.size
    if known:
        _fit(closing, h, last)
        for a in range(n):
            closing.slope[a] += h * closing.bow[a]
        return
    for a in range(n):  # the first correction is the tangent at the beginning
        chord = closing.work.q[a] - closing.before[a]
        closing.slope[a] = (2.0 * chord - closing.way[a]) / h
        closing.bow[a] = 2.0 * (chord - closing.way[a]) / (h * h)


@inner
def _land(closing: Closing, s: float, exactly: bool) -> bool:
    """Newton's method from `guess`, with the active values at s; returns whether it is sound."""
    copy(closing.before, closing.work.q)
    for a in range(closing.ahead.size):
        closing.work.q[a] = closing.guess[a]
    _put_line(closing, s)
    return settle(closing, closing.tight, exactly) and is_sound(closing, closing.guess)


@inner
def _interpolate(closing: Closing, u: float) -> None:
    """`guess` at u from the polynomial through the four places, at -2, -1, 1, and 2."""
    n = closing.ahead.size
    for a in range(n):
        closing.guess[a] = 0.0
    for j in range(4):
        weight = 1.0
        for k in range(4):
            if k != j:
                weight *= (u - _PLACES[k]) / (_PLACES[j] - _PLACES[k])
        for a in range(n):
            closing.guess[a] += weight * closing.places[j * n + a]


@inner
def _guess_beside(closing: Closing, first: bool, u: float, v: float) -> None:
    """`guess`, u from `before` on the polynomial there if it is the first, else as `_interpolate`
    at v."""
    if not first:
        _interpolate(closing, v)
        return
    for a in range(closing.ahead.size):
        curve = closing.slope[a] + 0.5 * u * closing.bow[a]
        closing.guess[a] = closing.before[a] + u * curve


@inner
def _beside(closing: Closing, s: float, w: float, closer: float, first: bool) -> float:
    """Put four places around s = 1 at the distance `closer`, from those at w or from `before`;
    returns the mean sharpness of the outer ones, or -1 if one of them is not found."""
    n, sides = closing.ahead.size, 0.0
    for j in range(4):
        at = _PLACES[j] * closer
        _guess_beside(closing, first, 1.0 - s + at, at / w)
        if not _land(closing, 1.0 + at, True):
            return -1.0
        if j == 0 or j == 3:
            sides += 0.5 * np.exp(sharpness(closing) - closing.trail[SHARPEST])
        for a in range(n):
            closing.places[(4 + j) * n + a] = closing.work.q[a]
    for i in range(4 * n):
        closing.places[i] = closing.places[4 * n + i]
    return sides


@inner
def _straddle(closing: Closing, s: float, h: float, last: float) -> bool:
    """The posture at s = 1, in `work`, from places on either side; returns whether they are found.

    The branch goes from `before`, at s, over s = 1. What the four places tell of the posture is
    off by the fourth power of their distance, so closer ones are found from them, until Newton's
    method is sound at s = 1, or the posture is known as well as by it.
    """
    work, n, size = closing.work, closing.ahead.size, closing.tight.size
    if not take_step(closing, s, (1.0 + _OVER) * h, True, True):
        return False
    way = furthest(work.q, closing.before, n) / ((1.0 + _OVER) * h)
    _fit(closing, (1.0 + _OVER) * h, last)
    w = 0.5 * _OVER * h
    sides = _beside(closing, s, w, w, True)
    if sides < 0.0:
        return False
    _interpolate(closing, 0.0)
    sound = _land(closing, 1.0, False)
    if np.exp(sharpness(closing) - closing.trail[SHARPEST]) < _CROSSED * sides:
        closing.trail[CROSSES] = 1.0
    level, closer = 0, _CLOSER * w
    for _ in range(_TRIES):
        sound = sound and is_regular(closing, closing.before, _NEAR * w * way)
        if sound or level == _LEVELS or w * way < _CLOSE * size:
            break
        if _beside(closing, s, w, closer, False) < 0.0:
            closer *= _AGAIN
            continue
        w, closer, level = closer, _CLOSER * closer, level + 1
        _interpolate(closing, 0.0)
        sound = _land(closing, 1.0, False)
    _interpolate(closing, 0.0)
    crossing = closing.trail[CROSSES] > 0.0
    if not (_land(closing, 1.0, False) or _land(closing, 1.0, True)) and crossing:
        for a in range(n):
            work.q[a] = closing.guess[a]
        settle(closing, closing.loose, False)
    for a in range(n):
        p, q = closing.places[a], closing.places[n + a]
        r, t = closing.places[2 * n + a], closing.places[3 * n + a]
        closing.slope[a] = (p - 8.0 * q + 8.0 * r - t) / (12.0 * w)
        closing.bow[a] = (p - q - r + t) / (3.0 * w * w)
    return True


@inner
def _carried(closing: Closing) -> bool:
    """Turn the derivatives at the end of the last line into those at the start of this one;
    returns whether there are any: the lines have one direction, or opposite ones."""
    along, last, this = 0.0, 0.0, 0.0
    for k in range(closing.wanted.size):
        x, y = closing.stride[k], closing.wanted[k] - closing.asked[k]
        along, last, this = along + x * y, last + x * x, this + y * y
    if last == 0.0 or along * along < (1.0 - 1e-9) * last * this:
        return False
    f = along / last
    for a in range(closing.ahead.size):
        closing.slope[a] *= f
        closing.bow[a] *= f * f
    return True


@inner
def go_along(closing: Closing, hasty: bool) -> float:
    """The candidate along the line from `asked` to `wanted`, in `work`; returns how far it came, a
    part of the line. `hasty`: how far exactly does not matter."""
    work = closing.work
    copy(closing.q, closing.before)
    copy(closing.turns, closing.turned)
    steps, reach = 1.0, 0.0
    for k in range(closing.wanted.size):
        angle, move = closing.is_angle[k] != 0, abs(closing.wanted[k] - closing.asked[k])
        steps = max(steps, move / (_TURN if angle else _MOVE * closing.tight.size))
        reach = max(reach, move if angle else move / closing.tight.size)
    s, h, last = 0.0, 1.0 / np.ceil(steps), 0.0
    widest, again, exactly, fine = h, True, False, 0
    known, skips = _carried(closing), 0
    wider = _WIDE / reach if reach > 0.0 else 0.0
    closing.trail[CROSSES], closing.trail[LEAST] = 0.0, np.inf
    begin_mode(closing, closing.before)
    while s < 1.0:
        strict = h > _FINE * widest
        fine += 0 if strict else 1
        if fine > PATIENCE or (hasty and not strict):
            break
        rest = 1.0 - s
        if h < rest < 2.0 * h and strict:  # not a short step at the end
            h = 0.5 * rest if rest > _STRETCHED * h else rest
        to = s + h
        if 1.0 - to < 0.5 * _FINEST * widest:
            to, h = 1.0, rest
        copy(closing.before, work.q)
        begin_at(closing, work.q)
        by = known and strict
        good = take_step(closing, s, h, by, exactly) if strict else _creep(closing, s, h)
        if not good and by and to < 1.0 and (s == 0.0 or h < STALE * last):
            by = False
            good = take_step(closing, s, h, by, True)
        wide = strict and h * reach > _PASSED
        good = good and not (wide and is_left(closing))
        beside = good and strict and not is_regular(closing, closing.before, _error(closing, by))
        if by and to == 1.0 and wide:
            good = good and not beside
        elif by and to == 1.0 and (beside or not good):
            width = max(h, wider)
            while width >= h:
                if _straddle(closing, s, width, last):
                    count(closing, closing.before, closing.turned)
                    return 1.0
                width *= SHORTER
            if beside and skips == _SKIPS:
                good = take_step(closing, s, h, s > 0.0, True)
                by = s > 0.0
        if beside and skips < _SKIPS:
            good, skips = False, skips + 1
        if good:
            count(closing, closing.before, closing.turned)
            learn_line(closing, h, last, by)
            copy(work.q, closing.before)
            begin_mode(closing, work.q)
            s, last, known = to, h, True
            h = min((LONGER if strict else 2.0) * h, widest) if again else h
        else:
            h *= SHORTER if strict else 0.5
            if h < _FINEST * widest:
                break
        # beside a position where branches meet A holds the soft mode back, but not in exact steps
        exactly, again = beside or not (good and strict), good
    copy(closing.before, work.q)
    return s

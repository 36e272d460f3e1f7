"""The error of a step: its free part, and an estimate that tells when fixed steps are too long.

Two embedded formulas give differences of the velocity, h Σ e_s ξ̈_s, from the stages of the step
itself: one of a higher order in h, `high`, and one of a lower order, `low`. With ρ = high / low,

    ε = high ρ² / (1 + ρ²)

follows the error of the method over the whole range in which a step says anything: the weights of
`low` are scaled such that ρ = 1 lies a third below the stability limit. Up to there ε is the error
on ẍ = -ω² x within a factor of two or so, and beyond it is `high`, which grows as the error does.
An implicit method has no `low`, and ε = high. Beyond the stability limit of an explicit one, stiff
elements chatter, however small the force and the motion: there ε is not small against h ξ̈.
`Method.sharp` is the part that it reaches at about 0.7 of that limit.

An error of the velocity lasts: on ẍ = -ω² x it has become one of ε / ω when the velocity turns,
and 1 / ω is longer than a short step. There ρ falls with ω h, so that a step is off by

    h ε max(1, c / ρ) / size

with c = `Method.lasting` such that this is the error of the method far below the limit. Of that
only the part along the free directions counts, which takes a solve: it is made where the whole is
large enough to matter. Small errors therefore cost one pass over the rates of the stages.

The velocity after an impact lasts. Of a short impact ε tells little: it is a difference of stages
on either side of the turn. A step of ω h drops a part c (ω h)ᵖ of the change of the velocity
(`Method.impact`). ω shows in the stages, or too large a value where more than a stop changes the
force. Between a kink that is met and the next one, where a stop is left, half a period passes, so
ω is π / T with this time T. The smaller of both losses counts, where the second kink is passed,
with the displacement that it becomes in 1000 steps.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.arc_coordinates import straighten
from alf_ros.kernel.augmented_solve import iterate
from alf_ros.kernel.data import NOTHING, Method, System, Until, Work
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.grazed_kinks import BEGUN, ENDED, FAR, UNFOUND
from alf_ros.kernel.interpolated_stages import linearise_aside
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import block, largest_of, zeros
from alf_ros.kernel.numba_ext.jit import FOUR, ONE, THREE, TWO, ZERO, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import pick
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import FOURS, largest, largest_coordinate, zero
from alf_ros.kernel.status import OK, TOO_LONG

# where `Work.judged` holds what
RECENT = 0  # sum of the errors of about the last 1000 steps, of the size
LOST = 1  # of about the last 100
UNRESOLVED = 2  # how many of the last 1000 or so do not resolve the acceleration
STEPS = 3  # how many these are: fewer after a start
WORST = 4  # highest level so far, and what the others were when it was reached
WORST_ERROR = 5
WORST_UNRESOLVED = 6
WORST_STEPS = 7
# since the last kink that ended a step:
SINCE = 8  # s
LONGEST = 9  # s, of a step near a kink
CHANGED = 10  # m/s, by these
TOUCHED = 11  # m/s of it that they lose by ω
JUDGED = 12  # numbers in all

LEVEL = 1e-3  # of the size: sum of errors of 1000 steps from which on steps are too long
FEWEST = 100.0  # steps: a sum of fewer is compared with LEVEL as if it were of so many
MOST_UNRESOLVED = 200.0  # steps of 1000, likewise
_WINDOW = 1000.0  # steps, of which a sum is
_MEMORY, _SHORT_MEMORY = 1e-3, 1e-2  # part of a sum that each step forgets
_PIECE = np.uint64(256)  # coordinates at a time
TELLS = 1e-6  # of the size: errors below never reach LEVEL
_APART = 0.03  # part of their way: stages that are nearer do not tell ω
FINEST = 1e-10  # of the size: errors below may be rounding


@inner
def free_part(unit: Unit, system: System, work: Work) -> float:
    """The largest of M⁻¹ p along the free directions, by the factor of the end of the step.

    The projection removes the part across, in which a singular position appears first.
    """
    zero(work.r2)
    zero(work.y)
    zero(work.along)
    for i in range(work.p.size):  # the blocks that do not move have no p
        work.delta[i] = work.p[i]
    iterate(unit, system, work, work.p, work.along, Until(np.int64(3), 1e-3, 1.0))
    return largest(work.along, work.p.size)


@inner
def embedded_errors(method: Method, work: Work) -> tuple[float, float, float]:
    """(high / h, low / h, |ξ̈| of the first stage), m/s², of the step that ended in `work`.

    The stages are even in number. With four of them one pass does, and costs half.
    """
    if method.b.size == 4:
        return _of_four(method, work)
    n, stages = np.uint64(work.sum.size), np.uint64(method.b.size)
    k, out, other, e = work.k, work.sum, work.sum_q, method.estimate
    high, low, first = 0.0, 0.0, 0.0
    high2, low2, first2 = 0.0, 0.0, 0.0
    begin = ZERO
    while begin < n:  # pieces that the fastest memory holds
        end = begin + _PIECE
        if end > n:
            end = n
        for s in range(ZERO, stages, TWO):
            a, b, c, d = e[s], e[s + ONE], e[stages + s], e[stages + s + ONE]
            at = (THREE * s + ONE) * n
            to = at + THREE * n
            if s == ZERO:
                for i in range(begin, end):
                    out[i] = a * k[at + i] + b * k[to + i]
                    other[i] = c * k[at + i] + d * k[to + i]
            elif a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
                for i in range(begin, end):
                    out[i] += a * k[at + i] + b * k[to + i]
                    other[i] += c * k[at + i] + d * k[to + i]
        half = (end - begin + ONE) // TWO  # two by two: a maximum waits for the one before
        for i in range(begin, begin + half):
            j = begin + end - ONE - i
            high, low = max(high, abs(out[i])), max(low, abs(other[i]))
            first = max(first, abs(k[n + i]))
            high2, low2 = max(high2, abs(out[j])), max(low2, abs(other[j]))
            first2 = max(first2, abs(k[n + j]))
        begin = end
    return max(high, high2), max(low, low2), max(first, first2)


@inner
def _of_four(method: Method, work: Work) -> tuple[float, float, float]:
    n, k, e = np.uint64(work.sum.size), work.k, method.estimate
    a, b, c, d = e[0], e[1], e[2], e[3]
    a2, b2, c2, d2 = e[4], e[5], e[6], e[7]
    first, second = section(k, n, n), section(k, FOUR * n, n)
    third, fourth = section(k, np.uint64(7) * n, n), section(k, np.uint64(10) * n, n)
    highs, lows, firsts = zeros(FOURS), zeros(FOURS), zeros(FOURS)
    high, low, most = 0.0, 0.0, 0.0
    for i in each(ZERO, n // FOUR):
        u, v = block(FOURS, first, i), block(FOURS, second, i)
        w, x = block(FOURS, third, i), block(FOURS, fourth, i)
        highs = largest_of(highs, a * u + b * v + (c * w + d * x))
        lows = largest_of(lows, a2 * u + b2 * v + (c2 * w + d2 * x))
        firsts = largest_of(firsts, u)
    for i in each(n - n % FOUR, n):
        high = max(high, abs(a * first[i] + b * second[i] + (c * third[i] + d * fourth[i])))
        low = max(low, abs(a2 * first[i] + b2 * second[i] + (c2 * third[i] + d2 * fourth[i])))
        most = max(most, abs(first[i]))
    high, low = max(high, largest_coordinate(highs)), max(low, largest_coordinate(lows))
    return high, low, max(most, largest_coordinate(firsts))


@inner
def embedded_difference(method: Method, work: Work) -> None:
    """h Σ e_s ξ̈_s / h, whose largest is `high` / h, into `work.sum`."""
    n, out = np.uint64(work.sum.size), work.sum
    zero(out)
    for s in range(np.uint64(method.b.size)):
        weight, at = method.estimate[s], (THREE * s + ONE) * n
        for i in range(n):
            out[i] += weight * work.k[at + i]


@inner
def _note_kinks(method: Method, work: Work, h: float, near: float) -> float:
    """Note the step of h (s); returns the velocity (m/s) that was lost between two kinks, if it
    ends the time between them, and 0 else. `near` as of `judge`."""
    judged, lost = work.judged, 0.0
    if near == BEGUN:
        lost = _lost_since(method, judged)
    judged[SINCE] += h
    if near > FAR:
        square, changed = _squared_rate(method, work, h)
        part = method.impact[0] * square ** (0.5 * method.impact[1])
        judged[LONGEST] = max(judged[LONGEST], h)
        judged[CHANGED] += changed
        judged[TOUCHED] += changed * min(1.0, part)
    if near == ENDED:
        lost = _lost_since(method, judged)
    elif near == UNFOUND:
        lost = judged[TOUCHED]
        judged[TOUCHED] = 0.0
    return lost


@inner
def _lost_since(method: Method, judged: Floats) -> float:
    """The velocity (m/s) lost since the last kink. The next one begins its count."""
    ratio = np.pi * judged[LONGEST] / (judged[SINCE] + NOTHING)  # ω h, with π / ω = T
    part = min(1.0, method.impact[0] * ratio ** method.impact[1])
    lost = min(judged[TOUCHED], part * judged[CHANGED])
    for k in range(SINCE, JUDGED):
        judged[k] = 0.0
    return lost


@inner
def _squared_rate(method: Method, work: Work, h: float) -> tuple[float, float]:
    """(ω h)² of the step of h (s), and the velocity (m/s) that it changes. Stages have moved by
    h Σ a_sm ξ̇_m, and ξ̈ changes by ω² times that, from one to the next or to the first."""
    n, k, stages = np.uint64(work.sum.size), work.k, np.uint64(method.b.size)
    square, most, farthest = 0.0, 0.0, 0.0
    for s in range(ONE, stages):
        for other in (ZERO, s - ONE):
            changed, moved = 0.0, 0.0
            for i in range(n):
                way = 0.0
                for m in range(s + ONE):
                    weight = method.a[s * stages + m] - method.a[other * stages + m]
                    way += weight * k[THREE * m * n + i]
                acceleration = k[(THREE * s + ONE) * n + i]
                changed = max(changed, abs(acceleration - k[(THREE * other + ONE) * n + i]))
                moved = max(moved, h * abs(way))
                most = max(most, abs(acceleration))
            farthest = max(farthest, moved)
            if moved > _APART * farthest:
                square = max(square, h * h * changed / (moved + NOTHING))
    return square, h * most


@inner
def remember(judged: Floats, moved: float, caution: float, unresolved: bool, counts: bool) -> None:
    """Add the error of a step that `counts`, in parts of the size, to the sums of recent steps;
    `caution`: what their sum is multiplied by where steps are judged."""
    recent = judged[RECENT] + (moved - _MEMORY * judged[RECENT])
    rough = judged[UNRESOLVED] + (pick(unresolved, 1.0, 0.0) - _MEMORY * judged[UNRESOLVED])
    steps = judged[STEPS] + (1.0 - _MEMORY * judged[STEPS])
    each = recent / max(steps, FEWEST)
    level = max(caution * each * (_WINDOW / LEVEL), rough * (1.0 / MOST_UNRESOLVED))
    worse = counts & (level > judged[WORST])
    judged[LOST] = pick(counts, lost_lately(judged, moved), judged[LOST])
    judged[RECENT] = pick(counts, recent, judged[RECENT])
    judged[UNRESOLVED] = pick(counts, rough, judged[UNRESOLVED])
    judged[STEPS] = pick(counts, steps, judged[STEPS])
    judged[WORST] = pick(worse, level, judged[WORST])
    judged[WORST_ERROR] = pick(worse, recent, judged[WORST_ERROR])
    judged[WORST_UNRESOLVED] = pick(worse, rough, judged[WORST_UNRESOLVED])
    judged[WORST_STEPS] = pick(worse, steps, judged[WORST_STEPS])


@inlined
def lost_lately(judged: Floats, moved: float) -> float:
    """The errors of about the last 100 steps after one more; above 1 steps are too long."""
    return judged[LOST] + (moved - _SHORT_MEMORY * judged[LOST])


@inner
def judge(
    unit: Unit, system: System, method: Method, work: Work, h: float, whole: float, near: float
) -> int:
    """Note the error of the step of h (s) that ended in `work`, with Φ_q and factor of its end.
    `whole` (s): the step of the grid, of which it may be a piece; `near`: as in `Kinks`.

    Returns TOO_LONG if the errors of the last steps exceed the mechanism itself, else OK. A method
    without an estimate, as of an adaptive integrator, is not judged.
    """
    if method.estimate.size == 0:
        return OK
    judged = work.judged
    high, low, first = embedded_errors(method, work)
    moved, sharp = 0.0, False
    if high > NOTHING:
        part = high * high / (high * high + low * low)
        error = high * part
        moved = h * h * (max(high, method.lasting * low) * part) / system.size
        sharp = error > method.sharp * first
        if moved > TELLS or (sharp and moved > FINEST):
            if work.aside[0]:
                linearise_aside(unit, system, work)
            embedded_difference(method, work)
            straighten(unit, system.arms, work.chart, work.sum)
            zero(work.p)
            add_mass_times(unit, system.mass, 1.0, work.sum, work.p)
            add_soft_times(unit, system.soft, 1.0, work.sum, work.p)
            moved *= free_part(unit, system, work) / high
            if work.aside[0]:
                linearise(unit, system, work, work.q)
        if not moved < 1.0:
            moved = 1.0
    lost = _note_kinks(method, work, h, near)
    if lost > 0.0:  # known, not an estimate
        judged[RECENT] += min(1.0, lost * _WINDOW * whole / system.size) / method.caution
    remember(judged, moved, method.caution, sharp and moved > FINEST, True)
    return TOO_LONG if judged[LOST] > 1.0 else OK

"""Kinks of the forces that are met and left within one step, such as a stop that is only grazed.

Stages may miss such a kink, and then neither they nor the embedded errors know of it. So the
motion between the ends of a step is looked at, by the scalars x of effects that have `interval`.
Each stays in its interval or leaves it. ξ is interpolated in the coordinates of the step, by

    the polynomial of degree 5 through ξ, ξ̇ and ξ̈ at both ends,

and x and ẋ are evaluated at a few places on it. Between two places x is a cubic. Where it turns in
another interval than before and after, or so near to an end of its interval that the interpolation
does not tell, the step has to end: at the turn x is as accurate as the motion. The step that ends
there meets a kink at most once, which its stages see, and the step after it leaves it. The
difference to the cubic through ξ and ξ̇ is the doubt about the interpolation.

A kink that is met and not left within the step is seen by the stages. Adaptive steps notice it by
their error. A fixed step across it would have an error of second order in h, so it ends there as
well, if the intervals on both sides are much wider than the way of the step: stops and contacts
are, close rows of a table are not. An impact that the step does not resolve makes its end and the
interpolation wrong. So fixed steps believe a kink close to an end only if the rate there confirms
it, and end where the first stage is beyond a kink that neither end is beyond.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.kernel.arc_coordinates import unfold
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.numba_ext.calls import call, call_for_number
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, by_address, expanded, inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe

# of `Kinks.near`: what is known of a step
FAR, BESIDE, ENDED, BEGUN, UNFOUND = 0.0, 1.0, 2.0, 3.0, 4.0
PARTS = 8  # of a step, between whose ends x is a cubic
PLACES = PARTS + 1
_ASIDE = np.uint64(2)  # part from either end at which the doubt is measured …
_SCALE = 32.0 / 9.0  # … and 1 / (4 θ (1 - θ))² there, twice, as the doubt is an estimate
_FAR = 2.0  # times what a scalar may move in a step
_EDGE = 1e-6  # of a step: a turn so close to an end is the end
_ROUNDED = 1e-13  # of the size, or rad: a kink that is passed by less is not
_NEAR = 1e-5  # of a step: one crossed so close to an end is at the end
_PASSED = 1e-3  # of the way in a step: a stage that is less far beyond a kink changes little
_WIDE = 10.0  # times the way of x in a step: intervals of kinks at which it ends
_HALVINGS = 20


@expanded
def unresolved_kink(problem: Problem, phase: Phase, t: float, h: float) -> float:
    """The part of the step of h (s) from `phase` at t (s), which ended in `work`, at which a step
    has to end so that a kink is seen; 1 if the step may stay.

    Needs q, q̇ of the end and the rates of the stages in `work`. Leaves q and q̇ there.
    """
    return call_for_number(problem.forces.kinks.search[0], problem, phase, t, h)


def _search(problem: Problem, phase: Phase, t: float, h: float) -> float:
    work, parts, found = problem.work, np.uint64(PARTS), 1.0
    keep_end(problem)
    end_in_arcs(problem, h)
    measure(problem, t + h, parts)
    copy(phase.q, work.q)
    copy(phase.qd, work.qd)
    prescribe(problem.system, t, work.q, work.qd, work.qdd)
    measure(problem, t, np.uint64(0))
    place(problem, phase, t, h, 0.5, 1.0)
    measure(problem, t + 0.5 * h, parts // TWO)
    far, ends = all_far(problem, h), problem.forces.kinks.crossed[0] == 0.0
    near = problem.forces.kinks.near
    near[0] = FAR if far else BESIDE
    if not far:
        found = _searched(problem, phase, t, h)
        for k in range(problem.forces.kinks.interval.size):
            if _leaves(problem, k):
                if ends:
                    found = _crossing(problem, phase, t, h, k, found)
                else:
                    near[0] = ENDED
        if ends:
            found = _strayed(problem, phase, t, h, found)
    restore_end(problem)
    return found


@inner
def keep_end(problem: Problem) -> None:
    """Keep q, q̇ of the end of the step, and how far its arcs have turned there."""
    work, ended, chart = problem.work, problem.work.ended, problem.work.chart
    copy(work.q, ended.q)
    copy(work.qd, ended.qd)
    copy(chart.sin, ended.sin)
    copy(chart.cos, ended.cos)
    copy(chart.rho, ended.rho)


@inner
def restore_end(problem: Problem) -> None:
    """The same back into `work`."""
    work, ended, chart = problem.work, problem.work.ended, problem.work.chart
    copy(ended.q, work.q)
    copy(ended.qd, work.qd)
    copy(ended.sin, chart.sin)
    copy(ended.cos, chart.cos)
    for i in range(chart.rho.size):
        chart.rho[i], chart.per_rho[i] = ended.rho[i], 1.0 / ended.rho[i]


@inner
def all_far(problem: Problem, h: float) -> bool:
    """Whether no scalar can leave its interval in the step of h (s) and return, and none leaves
    it that may not: where the step begins, in its middle and where it ends, each is farther from
    the ends of its interval than it may move, or goes one way, at a rate that changes by less
    than itself."""
    path, half = problem.forces.kinks.path, np.uint64(2 * PARTS)
    rounded, ends = (
        _ROUNDED * max(1.0, problem.system.size),
        problem.forces.kinks.crossed[0] == 0.0,
    )
    for k in range(problem.forces.kinks.interval.size):
        at = np.uint64(4 * PLACES) * k
        x, middle, y = path[at], path[at + half], path[at + TWO * half]
        v, w = path[at + ONE], path[at + TWO * half + ONE]
        moved = h * (abs(v) + abs(w)) + abs(middle - x) + abs(y - middle)
        if ends and _leaves(problem, k):
            return False
        low, high = path[at + TWO], path[at + THREE]
        room = min(min(x, min(middle, y)) - low, high - max(x, max(middle, y)))
        if room > _FAR * moved or moved < rounded:
            continue
        u = path[at + half + ONE]
        slowest, fastest = min(v, min(u, w)), max(v, max(u, w))
        if not min(abs(slowest), abs(fastest)) > fastest - slowest:
            return False
    return True


@inner
def _leaves(problem: Problem, k: np.uint64) -> bool:
    """Whether the step ends in another interval of scalar k, and both are wide."""
    path, at = problem.forces.kinks.path, np.uint64(4 * PLACES) * k
    to = at + np.uint64(4 * PARTS)
    if path[at + TWO] == path[to + TWO]:
        return False
    way = _WIDE * abs(path[to] - path[at])
    return min(path[at + THREE] - path[at + TWO], path[to + THREE] - path[to + TWO]) > way


@inner
def _crossing(
    problem: Problem, phase: Phase, t: float, h: float, k: np.uint64, found: float
) -> float:
    """The part of the step at which scalar k leaves its interval, if it is less than `found` and
    not near an end of the step, or `found`."""
    path, kinks = problem.forces.kinks.path, problem.forces.kinks
    here = path[np.uint64(4 * PLACES) * k + TWO]
    last = np.uint64(4 * PLACES) * kinks.interval.size
    before, behind = 0.0, 1.0
    for _ in range(_HALVINGS):
        part = 0.5 * (before + behind)
        place(problem, phase, t, h, part, 1.0)
        _measure_one(problem, t + part * h, k, last)
        if path[last + TWO] == here:
            before = part
        else:
            behind = part
    at = np.uint64(4 * PLACES) * k
    if behind <= _NEAR:
        kinks.near[0] = ENDED if kinks.near[0] == ENDED else BEGUN
        return found if _beside(problem, at, h) else min(found, 0.25)
    if behind >= 1.0 - _NEAR:
        kinks.near[0] = ENDED
        return found if _beside(problem, at + np.uint64(4 * PARTS), h) else min(found, 0.75)
    return min(found, behind)


@inner
def _beside(problem: Problem, at: np.uint64, h: float) -> bool:
    """Whether the rate at place `at` of the path confirms that a kink is crossed within 1e-5 of
    the step of h (s) from there: an impact that is not resolved makes the interpolation wrong."""
    path = problem.forces.kinks.path
    x, low, high = path[at], path[at + TWO], path[at + THREE]
    rounded = _ROUNDED * max(1.0, problem.system.size)
    return min(x - low, high - x) <= 2.0 * _NEAR * h * abs(path[at + ONE]) + rounded


@inner
def _strayed(problem: Problem, phase: Phase, t: float, h: float, found: float) -> float:
    """The part of the step at which the first stage is in an interval where its scalar is at
    neither end, if it is less than `found`, or `found`. Stages before it are not mistaken."""
    kinks, method, work = problem.forces.kinks, problem.method, problem.work
    stages, n = np.uint64(method.b.size), np.uint64(work.p.size)
    last = np.uint64(4 * PLACES) * kinks.interval.size
    rounded = _ROUNDED * max(1.0, problem.system.size)
    for s in range(ONE, stages):
        for i in range(n):
            work.q[i], work.qd[i] = 0.0, work.k[THREE * s * n + i]
            for m in range(s + ONE):
                work.q[i] += h * method.a[s * stages + m] * work.k[THREE * m * n + i]
        prescribe(problem.system, t + method.c[s] * h, work.q, work.qd, work.qdd)
        unfold(problem.unit, problem.system, work, phase)
        for k in range(kinks.interval.size):
            at = np.uint64(4 * PLACES) * k
            if kinks.path[at + TWO] != kinks.path[at + np.uint64(4 * PARTS) + TWO]:
                continue
            _measure_one(problem, t + method.c[s] * h, k, last)
            x, low, high = kinks.path[last], kinks.path[at + TWO], kinks.path[at + THREE]
            if max(low - x, x - high) > _PASSED * h * abs(kinks.path[at + ONE]) + rounded:
                return min(found, method.c[s] if method.c[s] < 1.0 else 0.75)
    return found


@inner
def _searched(problem: Problem, phase: Phase, t: float, h: float) -> float:
    """The result of the search, where a scalar may come to an end of its interval."""
    kinks, parts = problem.forces.kinks, np.uint64(PARTS)
    for j in range(ONE, parts):
        if j == _ASIDE or j == parts - _ASIDE:
            place(problem, phase, t, h, j / PARTS, 0.0)
            measure(problem, t + h * j / PARTS, j)
            _remember(problem, j)
        place(problem, phase, t, h, j / PARTS, 1.0)
        measure(problem, t + h * j / PARTS, j)
    _doubt(problem)
    found = 1.0
    for k in range(kinks.interval.size):
        found = _turn(problem, phase, t, h, k, found)
    return found


@inner
def end_in_arcs(problem: Problem, h: float) -> None:
    """ξ and ξ̇ where the step ends."""
    method, work, ended = problem.method, problem.work, problem.work.ended
    n = work.p.size
    zero(ended.xi)
    for i in range(n):
        ended.xid[i] = work.k[i]
    for s in range(method.b.size):
        if method.b[s] != 0.0:
            weight = h * method.b[s]
            first = THREE * s * n
            for i in range(n):
                ended.xi[i] += weight * work.k[first + i]
                ended.xid[i] += weight * work.k[first + n + i]


@inner
def place(problem: Problem, phase: Phase, t: float, h: float, part: float, fifth: float) -> None:
    """q and q̇ at a part of the step, interpolated: with ξ̈ if `fifth` is 1, without if it is 0."""
    work = problem.work
    interpolate(problem, h, part, fifth)
    prescribe(problem.system, t + part * h, work.q, work.qd, work.qdd)
    unfold(problem.unit, problem.system, work, phase)


@inner
def interpolate(problem: Problem, h: float, part: float, fifth: float) -> None:
    """ξ and ξ̇ there, into q and q̇ of `work`."""
    work, ended = problem.work, problem.work.ended
    n, a = work.p.size, part
    last = THREE * (problem.method.b.size - ONE) * n + n
    b = 1.0 - a
    bump = fifth * a * a * b * b  # what degree 5 adds, times what ends do not know of it
    slope = fifth * 2.0 * a * b * (b - a) / h
    for i in range(n):
        p, v0, v1 = ended.xi[i], h * work.k[i], h * ended.xid[i]
        c2, c3 = 3.0 * p - 2.0 * v0 - v1, v0 + v1 - 2.0 * p
        d0 = 0.5 * h * h * work.k[n + i] - c2  # ½ (ξ̈ - that of the cubic) h², at both ends
        d1 = 0.5 * h * h * work.k[last + i] - c2 - 3.0 * c3
        work.q[i] = a * (v0 + a * (c2 + a * c3)) + bump * (b * d0 + a * d1)
        work.qd[i] = (v0 + a * (2.0 * c2 + 3.0 * a * c3)) / h + slope * (b * d0 + a * d1)
        work.qd[i] += bump * (d1 - d0) / h


@inner
def measure(problem: Problem, t: float, j: np.uint64) -> None:
    """All scalars at q and q̇ in `work`, as place j of their paths."""
    for k in range(problem.forces.kinks.interval.size):
        _measure_one(problem, t, k, np.uint64(4) * (k * np.uint64(PLACES) + j))


@inner
def _measure_one(problem: Problem, t: float, k: np.uint64, at: np.uint64) -> None:
    """Scalar k at q and q̇ in `work`: x, ẋ and its interval, into the path from `at`."""
    work, effects, kinks = problem.work, problem.forces.effects, problem.forces.kinks
    e = kinks.effect[k]
    call(
        kinks.interval[k],
        t,
        work.q,
        work.qd,
        work.near,
        effects.slots,
        effects.slots_at[e],
        effects.params,
        effects.params_at[e],
        kinks.number[k],
        kinks.path,
        at,
    )


@inner
def _remember(problem: Problem, j: np.uint64) -> None:
    """x of the cubic at place j."""
    kinks, first = problem.forces.kinks, j == _ASIDE
    for k in range(kinks.interval.size):
        x = kinks.path[np.uint64(4) * (k * np.uint64(PLACES) + j)]
        kinks.doubt[TWO * k + (np.uint64(0) if first else ONE)] = x


@inner
def _doubt(problem: Problem) -> None:
    """How far the two interpolations are apart in the middle of the step."""
    kinks = problem.forces.kinks
    for k in range(kinks.interval.size):
        at = np.uint64(4) * (k * np.uint64(PLACES) + _ASIDE)
        other = np.uint64(4) * (k * np.uint64(PLACES) + np.uint64(PARTS) - _ASIDE)
        one = abs(kinks.path[at] - kinks.doubt[TWO * k])
        two = abs(kinks.path[other] - kinks.doubt[TWO * k + ONE])
        kinks.doubt[TWO * k] = _SCALE * max(one, two)


@inner
def _turn(problem: Problem, phase: Phase, t: float, h: float, k: np.uint64, found: float) -> float:
    """The first part of the step before `found` at which scalar k turns unresolved, or `found`."""
    path, first = problem.forces.kinks.path, np.uint64(4 * PLACES) * k
    for j in range(np.uint64(PARTS)):
        at = first + np.uint64(4) * j
        x, v = path[at], path[at + ONE] * h / PARTS
        y, w = path[at + np.uint64(4)], path[at + np.uint64(5)] * h / PARTS
        c2, c3 = 3.0 * (y - x) - 2.0 * v - w, v + w - 2.0 * (y - x)
        square = c2 * c2 - 3.0 * c3 * v
        if not square > 0.0:
            continue
        q = -c2 - np.copysign(np.sqrt(square), c2)
        for root in range(2):  # of v + 2 c₂ s + 3 c₃ s²
            s = v / q if root == 0 else (q / (3.0 * c3) if c3 != 0.0 else -1.0)
            part = (j + s) / PARTS
            if not (0.0 <= s <= 1.0 and _EDGE < part < min(found, 1.0 - _EDGE)):
                continue
            turn = x + s * (v + s * (c2 + s * c3))
            bend = c2 + 3.0 * c3 * s
            if _is_unresolved(problem, phase, (t, h), k, j, (part, turn, bend)):
                found = part
    return found


@inner
def _is_unresolved(
    problem: Problem,
    phase: Phase,
    step: tuple[float, float],
    k: np.uint64,
    j: np.uint64,
    turning: tuple[float, float, float],
) -> bool:
    """Whether scalar k, which turns behind place j, meets and leaves a kink there, or might.

    step: t and h; turning: the part of the step, x there, and the sign of ẍ.
    """
    (t, h), (part, turn, bend), kinks = step, turning, problem.forces.kinks
    path, first = kinks.path, np.uint64(4 * PLACES) * k
    low = np.uint64(2)
    here, unsure = path[first + low], part * (1.0 - part)
    unsure = 16.0 * kinks.doubt[TWO * k] * unsure * unsure
    alike = True
    for i in range(np.uint64(PLACES)):
        alike = alike and path[first + np.uint64(4) * i + low] == here
    rounded = _ROUNDED * max(1.0, problem.system.size)
    if alike:
        room = path[first + THREE] - turn if bend < 0.0 else turn - here
        if room > 2.0 * unsure + rounded:
            return False
    last = np.uint64(4 * PLACES) * kinks.interval.size
    place(problem, phase, t, h, part, 1.0)
    _measure_one(problem, t + part * h, k, last)
    turn, here, there = path[last], path[last + low], path[last + THREE]
    room, passed = (there - turn, turn - here) if bend < 0.0 else (turn - here, there - turn)
    if rounded < room < unsure:
        return True
    before, after = False, False
    for i in range(np.uint64(PLACES)):
        other = path[first + np.uint64(4) * i + low] != here
        if i <= j:
            before = before or other
        else:
            after = after or other
    return before and after and passed > rounded


@cache
def search(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Kinks` holds."""
    structs = Problem._numba_type(dimension), Phase._numba_type()
    return by_address(types.float64(*structs, types.float64, types.float64))(_search)

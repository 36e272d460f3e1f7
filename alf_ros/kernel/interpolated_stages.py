"""A stage, or the end of a step, that is too close to a singular position to be computed there.

Projection onto Φ = 0 along M, and what it leaves of momenta and forces, are smooth functions along
the branch, also through the position; only their equations are singular in it. So the functions
are evaluated at four places on either side and interpolated, to eighth order: the position Π(q),
then the velocity (33), then the acceleration (26). The places lie around the stage, or, if one of
them is not clear of the position, around the position. Applied forces are evaluated once, at the
interpolated position and velocity: a force that has a kink beside the position, such as a stop, is
not interpolated across the kink.

Lengths that miss the position by a little make another mechanism, which turns off there within a
distance too short to be resolved. It is passed as if they agreed, as far as this is harmless:
`Work.crossing` keeps by how much (m) they miss it, [1] the least with which a stage was refused.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.augmented_solve import accelerate_under, apply
from alf_ros.kernel.data import Phase, Problem, Scales, System, Work
from alf_ros.kernel.departure import (
    SAME,
    follow_branch,
    keep_part,
    leave_on_branch,
    meets_all,
    rests_apart,
    speed_of,
    way_of,
)
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import lost
from alf_ros.kernel.numba_ext.jit import TWO, inner
from alf_ros.kernel.numba_ext.vectors import copy, copy_first, furthest, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.projection import correct_at_last, opening_twofold
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import JAMMED, NOT_CLOSED, OK
from alf_ros.kernel.support_places import (
    PLACES,
    apart,
    narrow_places,
    position_of,
    store_place,
    weigh_places,
)
from alf_ros.kernel.work_ledger import ALL_FORCES, APPLIED, REACTION_DEPENDENT, record_power

# distance x to a singular position, below which only the direction of a stage's velocity is known
DIRECTION_ONLY = 1e-6
NEAR = 0.01  # distance x from which down a step may have passed a position without a word
_TURNED = 0.01  # part of the velocity by which a direction may be off
SPACING = 6.0  # of the places, in parts of the distance that is too close
_WIDER = 1.5  # spacing, where a support position is not clear of the singular position
_WIDEST = 0.5  # of the size: positions further apart do not determine values in between
_TRIES = 6
_NARROWER = 0.25  # of their spacing, where friction has no balance at one of the places
_NARROWEST = 0.02  # of the first spacing, above which they are moved closer once more
SLOW = 1e-3  # part of the speed that forces give, below which a velocity has no reliable direction
_BALANCED = 1e-12  # part of what forces give free masses, below which accelerations are rounding
_CLOSED = 1e-10  # part of the size
DRIFT = 1e-13  # part of the size by which lengths may miss the position without energy drifting
_SMOOTH = 10.0  # times what a smooth branch leaves: 29 is what lengths that disagree leave


@inner
def evaluate_interpolated(
    problem: Problem, phase: Phase, t: float, s: np.uint64, moved: float, scales: Scales
) -> int:
    """q̇ and q̈ of stage s, by interpolation, from `base`, p and `along` of `work`.

    `moved` (m): the distance by which the stage was off Φ = 0; `along`: q̇ as the step adds it up.
    Returns the iterations, as `stage` does.
    """
    work = problem.work
    count, found = _find(problem, phase, t, moved, scales, False)
    if not found:
        work.places[0] = np.inf  # of a sample, which has no limit then
        return count
    n = work.p.size
    for a in range(n):
        work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    prescribe(problem.system, t, work.q, work.qd, work.qdd)
    apply(problem, t)
    copy(work.Q, work.given)
    more = _interpolate_accelerations(problem, phase, t, s)
    position, spacing = position_of(work), 1.0
    while more < 0 and spacing > _NARROWEST:
        # the balance ends within reach: nearer places may have it, off by rounding
        spacing *= _NARROWER
        if abs(position) > spacing:
            break
        narrow_places(work, position / (spacing / _NARROWER), _NARROWER)
        more = _interpolate_accelerations(problem, phase, t, s)
    if more <= 0:
        return more
    prescribe(problem.system, t, work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a], work.qdd[a] = work.sum_q[a], work.sum_qd[a], work.sum[a]
    return max(count, more)


@inner
def _interpolate_accelerations(problem: Problem, phase: Phase, t: float, s: np.uint64) -> int:
    """q̈ of stage s from the places, under the forces that stand in `given`, into `sum`; returns
    the iterations, as `stage` does."""
    work, count = problem.work, 1
    n = work.p.size
    for a in range(n):
        work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    record_power(problem, phase, t, s, 1.0, APPLIED)
    zero(work.sum)
    for k in range(PLACES):
        more = evaluate_place(problem, t, k)  # (26)
        if more <= 0:
            return more
        count = max(count, more)
        record_power(problem, phase, t, s, work.place_weights[k], REACTION_DEPENDENT)
        for a in range(n):
            work.sum[a] += work.place_weights[k] * work.qdd[a]
    return count


@inner
def evaluate_uninterpolated(
    problem: Problem, phase: Phase, t: float, s: np.uint64, scales: Scales
) -> int:
    """q̇ and q̈ of stage s at the stage itself: where friction has no balance on the other side of
    the position. They are off by rounding. Returns the iterations, as `stage` does."""
    work = problem.work
    prescribe(problem.system, t, work.q, work.qd, work.qdd)
    copy(work.base, work.q)
    copy(work.base, work.target)
    count, _x, _clear = stage(problem, t, scales, True, True)
    record_power(problem, phase, t, s, 1.0, ALL_FORCES)
    return count


@inner
def evaluate_place(problem: Problem, t: float, k: int) -> int:
    """q̈ and λ at place k under the forces that act at the stage; returns the iterations."""
    system, work = problem.system, problem.work
    place_at(problem, t, k)
    copy(work.given, work.Q)
    if not linearise(problem.unit, system, work, work.q):
        return 0
    count, _sigma = accelerate_under(problem, t, True)  # (26)
    return count


@inner
def place_at(problem: Problem, t: float, k: int) -> None:
    """q and q̇ of place k into `work`."""
    system, work = problem.system, problem.work
    n = work.p.size
    at = TWO * n * np.uint64(k)
    prescribe(system, t + work.place_step[0] * apart(work, k), work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a] = work.places[at + a], work.places[at + n + a]


@inner
def end_interpolated(
    problem: Problem, phase: Phase, t: float, moved: float, scales: Scales
) -> tuple[int, int]:
    """q and q̇ of the end of a step, by interpolation; q is projected onto the rows that still
    determine it.

    The end that a step has added up is off the branch by its error, e. Projected at x < e it would
    come to lie on another branch. Returns (result, iterations).
    """
    unit, system, work = problem.unit, problem.system, problem.work
    count, found = _find(problem, phase, t, moved, scales, True)
    if count <= 0:
        return JAMMED if count < 0 else NOT_CLOSED, 1
    if found:
        for a in range(work.p.size):
            work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    prescribe(system, t, work.q, work.qd, work.qdd)
    apply(problem, t)  # an embedded error is relative to the forces
    if not linearise(unit, system, work, work.q):
        return NOT_CLOSED, count
    opening_twofold(unit, system, work)
    correct_at_last(unit, system, work)
    gap = opening_twofold(unit, system, work)
    if not gap <= _CLOSED * system.size:
        _refuse(work, gap)
        return NOT_CLOSED, count
    if not linearise(unit, system, work, work.q):
        return NOT_CLOSED, count
    work.aside[0], work.aside[1] = found, lost(unit, system, work)
    return OK, count


@inner
def linearise_aside(unit: Unit, system: System, work: Work) -> bool:
    """Φ_q and factor of the last place: they determine the free directions along the branch, which
    an end in the position itself does not."""
    n = work.p.size
    at = TWO * n * np.uint64(PLACES - 1)
    copy(work.q, work.base)
    for a in range(n):
        work.base[a] = work.places[at + a]
    return linearise(unit, system, work, work.base)


@inner
def _find(
    problem: Problem, phase: Phase, t: float, moved: float, scales: Scales, ending: bool
) -> tuple[int, bool]:
    """Interpolate position and velocity, into `sum_q` and `sum_qd`.

    The branch is followed along `along`: q̇ as the step adds it up, or from rest the acceleration.
    The velocity that `stage` found is not used, since its row may be turned by e / x.
    `ending`: for the end of a step, which is interpolated twice, the second time with direction
    and curvature of the first. Returns the iterations, and whether position and velocity were
    found. At a standstill without a direction the stage stays where it is. The same holds where
    the acceleration leads to a branch further off than the step has gone: the acceleration does
    not depend on the row that determines this branch, but q does.
    """
    work = problem.work
    if rests_apart(problem.system, work.base):
        copy(work.along, work.sum)
        own = scales_of(problem.system, work, phase, True)
        count, found = _find_along(problem, phase, t, moved, own, ending, True)
        if count > 0:
            return count, found
        copy(work.sum, work.along)  # what else moves is beside a singular position of its own
    return _find_along(problem, phase, t, moved, scales, ending, False)


@inner
def _find_along(
    problem: Problem,
    phase: Phase,
    t: float,
    moved: float,
    scales: Scales,
    ending: bool,
    apart: bool,
) -> tuple[int, bool]:
    """The same along the velocity of all, or `apart` of the part alone that rests there."""
    system, work = problem.system, problem.work
    n = work.p.size
    fastest = speed_of(system, apart, phase.qd, n)
    spacing = max(20.0 * moved, SPACING * system.close * scales.radius)
    moving = fastest > SLOW * scales.falling
    known = not moving and leave_on_branch(problem, apart)
    if apart:
        keep_part(system, work.along)
        moving = False  # what else moves stays where it is, and chords tell the way of this part
    speed = largest(work.along, n)
    least = 0.0 if moving else _BALANCED * largest(work.Q, n) / system.mean
    if not speed > least:
        return 1, False
    if 20.0 * moved > _WIDEST * system.size:  # so far off Φ = 0 is a stage of too long a step
        return 0, False
    bend = speed / fastest if moving else 0.0
    for a in range(n):
        work.curve[a] = bend * bend * work.bend[a]
    if not moving:
        count = follow_branch(problem, t, scales, spacing)
        if count <= 0:
            return count, False
    if apart:
        keep_part(system, work.along)
        keep_part(system, work.curve)
    count = _interpolate(problem, t, moving, scales, spacing)
    if count > 0 and apart and lost(problem.unit, system, work):
        return 0, False  # what else moves is in one of its own
    if count > 0 and not moving:
        gone = way_of(system, apart, work.base, phase.q, n) + SAME * system.size
        off = way_of(system, apart, work.sum_q, work.base, n)
        if off > gone and not (known and meets_all(problem, gone, apart)):
            prescribe(system, t, work.q, work.qd, work.qdd)
            copy(work.base, work.q)
            copy(work.base, work.target)
            count, _x, _clear = stage(problem, t, scales, True, True)
            return count, False
    speed, found = largest(work.along, n), largest(work.sum_qd, n)
    ask = ending or furthest(work.sum_qd, work.along, n) > _TURNED * speed
    if ask and count > 0 and moving and found > SLOW * scales.falling:
        # again, now that direction and curvature of the branch are known here
        _turn(work, work.place_step[0] * speed / found)
        more = _interpolate(problem, t, moving, scales, spacing)
        count = max(count, more) if more > 0 else more
    return count, count > 0


@inner
def _turn(work: Work, step: float) -> None:
    """Let `along` and `curve` be the derivatives of the branch by time, from the places, which are
    `step` (s) apart."""
    n = work.p.size
    copy_first(work.sum_qd, work.along, n)
    one = TWO * n
    two, three, four = one + one, one + one + one, one + one + one + one
    for a in range(n):  # sums of the places k on either side: 2 f + f'' k² + f⁗ k⁴ / 12
        first = work.places[four + a] + work.places[three + a]
        second = work.places[four + one + a] + work.places[two + a]
        third = work.places[four + two + a] + work.places[one + a]
        bent = (13.0 * (second - first) - 3.0 * (third - second)) / 24.0
        work.curve[a] = bent / (step * step)


@inner
def _interpolate(problem: Problem, t: float, moving: bool, scales: Scales, spacing: float) -> int:
    """`sum_q` and `sum_qd` from places `spacing` (m) apart along `along`; returns the iterations.

    `moving`: `along` is the velocity, so prescribed blocks are where they will be when the
    mechanism is at the place. If one of the places is not clear of the position, the next ones lie
    around the position and further apart. If they are never clear, the stage is refused. If they
    look as if lengths missed the position, `base` becomes the position found.
    """
    system, work = problem.system, problem.work
    n, most = work.p.size, 0
    speed = largest(work.along, n)
    position = 0.0  # about where, m along the branch
    beside = moving  # `base` may be beside the branch, and `along` turned
    for left in range(_TRIES, 0, -1):
        zero(work.sum_q)
        zero(work.sum_qd)
        good, step = True, spacing / speed
        work.place_step[0] = step if moving else 0.0
        weigh_places(work, position / spacing)
        for k in range(PLACES):
            away = step * apart(work, k)
            prescribe(system, t + work.place_step[0] * apart(work, k), work.q, work.qd, work.qdd)
            for a in range(n):
                # off Φ = 0 by little: the rows are turned by that over the distance
                place = work.base[a] + away * (work.along[a] + 0.5 * away * work.curve[a])
                work.q[a], work.target[a] = place, place
            count, x, clear = stage(problem, t, scales, True, False)
            if count <= 0:
                return count
            most = max(most, count)
            good = good and clear
            work.place_x[k] = x
            store_place(work, k)
            for a in range(n):
                work.sum_q[a] += work.place_weights[k] * work.q[a]
                work.sum_qd[a] += work.place_weights[k] * work.qd[a]
        if good:
            gap = _gap(system, work, spacing / scales.radius)
            if beside and left > 1 and gap > DRIFT * system.size:
                # places off by e slip by e² / x along the branch, which looks alike: from the
                # position and in the direction that were found they do not
                copy_first(work.sum_q, work.base, n)
                found = largest(work.sum_qd, n)
                if found > SLOW * scales.falling:
                    _turn(work, step * speed / found)
                    speed = found
                beside = False
                continue
            if gap > _CLOSED * system.size:
                _refuse(work, gap)
                return 0
            if gap > DRIFT * system.size:
                work.crossing[0] = max(work.crossing[0], gap)
            return most
        position = position_of(work) * spacing
        spacing *= _WIDER
    return 0


@inner
def _refuse(work: Work, gap: float) -> None:
    """Note that a stage is refused as lengths miss the position by `gap` (m)."""
    if not work.crossing[1] > 0.0 or gap < work.crossing[1]:
        work.crossing[1] = gap


@inner
def _gap(system: System, work: Work, part: float) -> float:
    """About by how much (m) the lengths miss the singular position that the places lie around; 0
    if unknown. `part`: their spacing, of the radius.

    Lengths that miss it by e turn x y = 0 into x y = e: places at x lie e / x beside the branch,
    on one side before the position and on the other behind it. The inner two places are compared
    with the prediction of the outer six for an odd function c1 k + c3 k³ + c5 k⁵ of place k. A
    smooth branch leaves 360 c7: c7 is about part⁷ of the size, or c5² / c3 where the radius is not
    known, as from rest. e / x leaves 5/8 of its size at k = 1, and 29 times 360 c5² / c3.
    """
    n, most, cubic, quintic = work.p.size, 0.0, 0.0, 0.0
    one = TWO * n
    two, three, four = one + one, one + one + one, one + one + one + one
    for a in range(n):
        nearest = 0.5 * (work.places[four + a] - work.places[three + a])
        second = 0.5 * (work.places[four + one + a] - work.places[two + a])
        third = 0.5 * (work.places[four + two + a] - work.places[one + a])
        fourth = 0.5 * (work.places[four + three + a] - work.places[a])
        # divided differences of the function over k, by k² = 4, 9 and 16
        nearer = (third / 3.0 - second / 2.0) / 5.0
        farther = (fourth / 4.0 - third / 3.0) / 7.0
        c5 = (farther - nearer) / 12.0
        c3 = nearer - 13.0 * c5
        predicted = second / 2.0 - 3.0 * nearer + 24.0 * c5
        most = max(most, abs(nearest - predicted))
        cubic, quintic = max(cubic, abs(c3)), max(quintic, abs(c5))
    told = 360.0 * quintic * quintic / max(cubic, 1e-100)
    if not (most > _SMOOTH * told and most > 2.0 * 360.0 * part**7 * system.size):
        return 0.0
    return 1.6 * part * most

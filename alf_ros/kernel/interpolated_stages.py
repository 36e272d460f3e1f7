"""A stage, or the end of a step, that is too close to a singular position to be computed there.

Projection onto Φ = 0 along M and what it leaves of momenta and forces are smooth functions along
the branch, also through the position; only their equations are singular in it. So they are
evaluated at four places on either side and interpolated, to eighth order: the position Π(q), then
the velocity (33), then the acceleration (26). Applied forces are evaluated once, at the position
and velocity found: a force that has a kink there, such as a stop, is not reached across.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.augmented_solve import accelerate_under, apply
from alf_ros.kernel.data import Forces, Phase, System, Work
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import lost
from alf_ros.kernel.numba_ext.jit import TWO, inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.projection import correct_at_last, opening_twofold
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import JAMMED, NOT_CLOSED, OK
from alf_ros.kernel.work_ledger import ALL, APPLIED, REACTING, tally

PLACES = 8
BLIND = 1e-6  # distance to a singular position from which on a stage's velocity is its direction
_TURNED = 0.01  # part of the velocity by which a direction may be off
_SPACING = 6.0  # of the places, in parts of what is too close
_WIDER = 3.0  # spacing, where one of the places is not clear of the position
_WIDEST = 0.5  # of the size: places further apart do not tell what is between
_TRIES = 4
_SLOW = 1e-3  # part of the speed that forces give, below which a velocity tells no direction
_CLOSED = 1e-10  # part of the size
_SAME = 1e-11  # part of the size by which a place that is found may be off by rounding
_WEIGHTS = (-1 / 70, 8 / 70, -28 / 70, 56 / 70, 56 / 70, -28 / 70, 8 / 70, -1 / 70)


@inner
def _offset(k: int) -> int:
    """-4, -3, -2, -1, 1, 2, 3, 4."""
    return k - 4 if k < 4 else k - 3


@inner
def evaluate_aside(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    s: np.uint64,
    moved: float,
    radius: float,
    close: float,
    falling: float,
    iterations: int,
) -> int:
    """q̇ and q̈ of stage s from `base`, p and `along` of `work`.

    `moved` (m): how far the stage was from Φ = 0; `along`: q̇ as the step adds it up.
    `radius`, `close`, `falling`: as `nearness` returns. Returns the iterations, as `stage` does.
    """
    count, found = _find(
        unit, system, forces, work, phase, t, moved, radius, close, falling, iterations, False
    )
    if not found:
        return count
    n = work.p.size
    for a in range(n):
        work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    prescribe(system, t, work.q, work.qd, work.qdd)
    apply(unit, system, forces, work, t)
    copy(work.Q, work.given)
    tally(forces.ledger.tally, system, forces, work, phase, t, s, 1.0, APPLIED)
    zero(work.sum)
    for k in range(PLACES):
        more = evaluate_place(unit, system, forces, work, t, k, iterations)
        if more <= 0:
            return more
        count = max(count, more)
        tally(forces.ledger.tally, system, forces, work, phase, t, s, _WEIGHTS[k], REACTING)
        for a in range(n):
            work.sum[a] += _WEIGHTS[k] * work.qdd[a]
    prescribe(system, t, work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a], work.qdd[a] = work.sum_q[a], work.sum_qd[a], work.sum[a]
    return count


@inner
def evaluate_there(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    s: np.uint64,
    radius: float,
    close: float,
    iterations: int,
) -> int:
    """The same at the stage itself, at its word: where friction finds no balance on the other side
    of the position. It is off by rounding."""
    prescribe(system, t, work.q, work.qd, work.qdd)
    copy(work.base, work.q)
    copy(work.base, work.target)
    count, _x, _clear = stage(unit, system, forces, work, t, radius, close, True, iterations, True)
    tally(forces.ledger.tally, system, forces, work, phase, t, s, 1.0, ALL)
    return count


@inner
def evaluate_place(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    k: int,
    iterations: int,
) -> int:
    """q̈ and λ at place k under the forces that act at the stage; returns the iterations."""
    n = work.p.size
    at = TWO * n * np.uint64(k)
    prescribe(system, t + work.lead[0] * _offset(k), work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a] = work.places[at + a], work.places[at + n + a]
    copy(work.given, work.Q)
    if not linearise(unit, system, work, work.q):
        return 0
    count, _sigma = accelerate_under(unit, system, forces, work, t, iterations, True)
    return count


@inner
def end_aside(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    moved: float,
    radius: float,
    close: float,
    falling: float,
    iterations: int,
) -> tuple[int, int]:
    """q and q̇ of the end of a step, likewise; q keeps to the rows that tell where it is.

    Whatever a step has added up is off the branch by its error, e. Projected at x < e it would
    come to lie on another branch. Returns (result, iterations).
    """
    count, found = _find(
        unit, system, forces, work, phase, t, moved, radius, close, falling, iterations, True
    )
    if count <= 0:
        return JAMMED if count < 0 else NOT_CLOSED, 1
    if found:
        for a in range(work.p.size):
            work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    prescribe(system, t, work.q, work.qd, work.qdd)
    apply(unit, system, forces, work, t)  # an embedded error is relative to what acts
    if not linearise(unit, system, work, work.q):
        return NOT_CLOSED, count
    opening_twofold(unit, system.rows, work.q, work.r2)
    correct_at_last(unit, system, work)
    gap = opening_twofold(unit, system.rows, work.q, work.r2)
    if not (gap <= _CLOSED * system.size and linearise(unit, system, work, work.q)):
        return NOT_CLOSED, count
    work.aside[0], work.aside[1] = found, lost(unit, system, work)
    return OK, count


@inner
def linearise_aside(unit: Unit, system: System, work: Work) -> bool:
    """Φ_q and factor of the last place: they tell the free directions along the branch, which an
    end in the position itself does not."""
    n = work.p.size
    at = TWO * n * np.uint64(PLACES - 1)
    copy(work.q, work.base)
    for a in range(n):
        work.base[a] = work.places[at + a]
    return linearise(unit, system, work, work.base)


@inner
def _find(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    moved: float,
    radius: float,
    close: float,
    falling: float,
    iterations: int,
    ending: bool,
) -> tuple[int, bool]:
    """Interpolate position and velocity, into `sum_q` and `sum_qd`.

    `along`: q̇ as the step adds it up, which the branch goes along; from rest it goes along the
    acceleration. The velocity that `stage` found is no use: its row may be turned by e / x.
    Returns the iterations, and whether they were found: at a standstill that knows no direction
    the stage stays. So it does where the acceleration leads to a branch further off than the step
    has gone: it does not feel the row that tells this branch, which q itself tells.
    `lead`: what is prescribed goes on by from place to place, s.
    """
    n = work.p.size
    fastest = largest(phase.qd, n)
    spacing = max(20.0 * moved, _SPACING * system.close * radius)
    moving = fastest > _SLOW * falling
    if not moving:
        copy(work.pull, work.along)
    speed = largest(work.along, n)
    if not speed > 0.0:
        return 1, False
    if 20.0 * moved > _WIDEST * system.size:  # so far off Φ = 0 is a stage of too long a step
        return 0, False
    bend = speed / fastest if moving else 0.0
    for a in range(n):
        work.curve[a] = bend * bend * work.bend[a]
    count = _interpolate(unit, system, forces, work, t, moving, radius, close, spacing, iterations)
    if count > 0 and not moving:
        gone = furthest(work.base, phase.q, n) + _SAME * system.size
        if furthest(work.sum_q, work.base, n) > gone:
            prescribe(system, t, work.q, work.qd, work.qdd)
            copy(work.base, work.q)
            copy(work.base, work.target)
            count, _x, _clear = stage(
                unit, system, forces, work, t, radius, close, True, iterations, True
            )
            return count, False
    found = largest(work.sum_qd, n)
    ask = ending or furthest(work.sum_qd, work.along, n) > _TURNED * speed
    if ask and count > 0 and moving and found > _SLOW * falling:
        # again, now that direction and curvature of the branch are known here
        _bend(work, work.lead[0] * speed / found)
        for a in range(n):
            work.along[a] = work.sum_qd[a]
        more = _interpolate(
            unit, system, forces, work, t, moving, radius, close, spacing, iterations
        )
        count = max(count, more) if more > 0 else more
    return count, count > 0


@inner
def _bend(work: Work, step: float) -> None:
    """The second derivative of the branch by time, from places that are `step` (s) apart."""
    n = work.p.size
    before, after = TWO * n * np.uint64(3), TWO * n * np.uint64(4)
    for a in range(n):
        middle = work.sum_q[a]
        apart = (work.places[after + a] - middle) + (work.places[before + a] - middle)
        work.curve[a] = apart / (step * step)


@inner
def _interpolate(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    moving: bool,
    radius: float,
    close: float,
    spacing: float,
    iterations: int,
) -> int:
    """The same from places `spacing` (m) apart along `along`; returns the iterations.

    `moving`: `along` is the velocity, so that what is prescribed is where it will be when the
    mechanism is there. Where one of the places is not clear of the position, all are taken
    further away.
    """
    n, most = work.p.size, 0
    speed = largest(work.along, n)
    for _ in range(_TRIES):
        zero(work.sum_q)
        zero(work.sum_qd)
        good, step = True, spacing / speed
        work.lead[0] = step if moving else 0.0
        for k in range(PLACES):
            away = step * _offset(k)
            prescribe(system, t + work.lead[0] * _offset(k), work.q, work.qd, work.qdd)
            for a in range(n):
                work.target[a] = work.base[a] + away * work.along[a]
                # a guess off Φ = 0 by less: there the rows are turned by that over the distance
                work.q[a] = work.target[a] + 0.5 * away * away * work.curve[a]
            count, _x, clear = stage(
                unit, system, forces, work, t, radius, close, True, iterations, False
            )
            if count <= 0:
                return count
            most = max(most, count)
            good = good and clear
            _keep(work, k)
            for a in range(n):
                work.sum_q[a] += _WEIGHTS[k] * work.q[a]
                work.sum_qd[a] += _WEIGHTS[k] * work.qd[a]
        if good:
            break
        spacing *= _WIDER
    return most


@inner
def _keep(work: Work, k: int) -> None:
    """Position and velocity of place k."""
    n = work.p.size
    at = TWO * n * np.uint64(k)
    for a in range(n):
        work.places[at + a], work.places[at + n + a] = work.q[a], work.qd[a]

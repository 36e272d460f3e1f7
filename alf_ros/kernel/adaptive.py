"""Steps as long as a tolerance allows, on a grid that is kept."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.arc_coordinates import turning
from alf_ros.kernel.companion import (
    BEGIN_CALL,
    END_STEP,
    is_accompanied,
    part_to_kink,
    tell,
)
from alf_ros.kernel.crossed_kinks import across_kinks, next_aim, passed, shorter
from alf_ros.kernel.data import Bearings, Method, Phase, Problem, Span, System, Work
from alf_ros.kernel.grazed_kinks import unresolved_kink
from alf_ros.kernel.interpolated_stages import linearise_aside
from alf_ros.kernel.kinks_over_time import end_of_drives, until_kink
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.singularity_monitor import may_have_passed
from alf_ros.kernel.status import (
    COLLAPSED,
    FORCE_JUMPS,
    JAMMED,
    NOT_CLOSED,
    NOT_POSITIVE,
    OK,
    STOPPED,
    TOO_MANY,
)
from alf_ros.kernel.step import (
    accept,
    least_sigma,
    linearise_first,
    note_leap,
    restore_grid_point,
    save_grid_point,
    step,
)
from alf_ros.kernel.step_error import free_part
from alf_ros.kernel.step_length import (
    LEAP,
    MOST,
    SHARE,
    SHORTEST,
    TURN,
    Last,
    displacement_error,
    judged,
    likely_rounding,
    momentum_error,
    next_pace,
    parts_of,
    relative,
    usual_speed,
)
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.trail import leave_trail
from alf_ros.kernel.work_ledger import ALL_FORCES, record_power

ENDED = 1e-6  # part of the step of the grid up to which the end of a balance is found
BEYOND = 1e-4  # the same: a step from where none is small enough shows whether it ends there
REFUSED = 40  # attempts, where lengths miss a singular position: shorter steps do not help then


@inner
def _error_norm(
    unit: Unit, system: System, method: Method, work: Work, which: int, h: float, speed: float
) -> float:
    """Embedded error `which` of the step of h that ended in `work`."""
    displacement_error(unit, system, method, work, which, h)
    displacement = free_part(unit, system, work)
    momentum_error(unit, system, method, work, which, h)
    return relative(system, displacement, free_part(unit, system, work), speed)


@inner
def _errors(
    unit: Unit,
    system: System,
    method: Method,
    work: Work,
    phase: Phase,
    h: float,
    share: float,
) -> tuple[float, float]:
    """Both relative errors of the step of h that ended in `work`, of order h⁶ and h⁴, in parts of
    `share`."""
    speed = usual_speed(system, work, phase)
    if work.aside[0]:
        linearise_aside(unit, system, work)
    fine = _error_norm(unit, system, method, work, 0, h, speed) / share
    coarse = _error_norm(unit, system, method, work, 1, h, speed) / share
    if work.aside[0]:
        linearise(unit, system, work, work.q)
    if np.isfinite(fine) and np.isfinite(coarse):
        return fine, coarse
    return np.inf, np.inf


@inner
def forget_end(bearings: Bearings) -> None:
    """No balance of friction has ended in this step of the grid yet."""
    if bearings.settle.size > 0:
        bearings.ended[0] = -np.inf


@inner
def collapsed(bearings: Bearings, result: int, begin: float) -> int:
    """Why no step from `begin` (s) is small enough, of which the trial beyond has this result:
    JAMMED if it finds no balance of friction, or if one of the steps tried has found none."""
    if bearings.settle.size > 0 and bearings.ended[0] >= begin:
        return JAMMED
    return JAMMED if result == JAMMED else COLLAPSED


@compiled
def advance_adaptively(
    problem: Problem,
    phase: Phase,
    span: Span,
    within: bool,
) -> tuple[int, int, int]:
    """Like `advance`, each h in as many steps as the tolerance of the method takes."""
    unit, system = problem.unit, problem.system
    method, work, kinks = problem.method, problem.work, problem.forces.kinks
    t0, first, steps, h = span
    pace, share = phase.pace, SHARE * method.tolerance
    good_pace = pace[0]
    save_grid_point(problem, phase)
    tell(problem, phase, BEGIN_CALL, 0, t0, 0.0)
    most, begun = 0, False
    tries, before, longer = 0, np.inf, h  # from here; error and length of the last
    if not linearise_first(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    sigma = 0.0 if within else least_sigma(phase)
    for taken in range(steps):
        forget_end(problem.forces.bearings)
        t, end = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        done, goal = 0.0, 0.0  # goal: where a step has to end besides the grid point
        since, cuts = 0.0, 0  # s since a kink was crossed; pieces on the way to crossings
        result, tried, refused = OK, 0, 0
        trial = False  # whether the step only tells if the balance of friction ends
        floor = 1.0  # what rounding leaves of the error, whatever the step
        expected = np.inf  # the most that the coarse error is without a kink, with `longer`
        while done < h:
            tried += 1
            if tried > MOST:
                result = TOO_MANY
                break
            aim = goal if goal > done else h
            left, begin, latest = aim - done, t + done, np.inf
            if kinks.instants.size > 0:
                ahead, earliest, latest = until_kink(kinks.instants, begin, left, h)
                begin = max(begin, earliest)
                if ahead < left:
                    left, aim = ahead, done + ahead
            longest = pace[0]
            if not begun:
                longest = min(longest, TURN / turning(unit, system.arms, phase))
            parts = parts_of(left, longest)
            dt = left / parts
            whole = parts == 1.0 and aim == h
            to = min(end if whole else begin + dt, latest)
            there = end_of_drives(to, end, whole)
            if not begun:
                work.sides[0] = np.nan
            work.sides[1] = 0.0
            result, count = step(problem, phase, (begin, to, dt, there), sigma, begun)
            most = max(most, count)
            if told_to_stop(work):
                result = STOPPED
                break
            if trial:
                result = collapsed(problem.forces.bearings, result, begin)
                break
            fine, coarse, error, factor = np.inf, np.inf, np.inf, 0.5
            if result == OK:
                fine, coarse = _errors(unit, system, method, work, phase, dt, share)
            if fine < np.inf:
                likely, across = likely_rounding(system, work.nearest[0]), work.sides[1] > 0.0
                last = Last(expected, before, float(tries), dt / longer)
                error, factor, floor = judged(fine, coarse, share, likely, across, floor, last)
            if error <= floor and kinks.search.size > 0:
                part = unresolved_kink(problem, phase, begin, dt)
                if part < 1.0:
                    goal, begun = done + part * dt, True
                    continue
            if error <= floor and is_accompanied(problem):
                across = across_kinks(cuts, h)
                part = part_to_kink(problem, phase, begin, dt, h, across)
                length = shorter(part, dt, across)
                if length < dt:
                    goal, cuts, begun = done + length, cuts + 1, True
                    continue
                if part < 0.0:
                    result = FORCE_JUMPS
                    break
                since = passed(since, part, dt)
                if since > 0.0:
                    goal = next_aim(done + dt, since, h)
            if error <= floor:
                result = tell(problem, phase, END_STEP, 0, begin, sigma)
                if result != OK:
                    break
                record_power(problem, phase, t, method.b.size, dt, ALL_FORCES)
                note_leap(system, work, phase, dt)
                accept(unit, system, work, phase)
                copy(problem.forces.bearings.force, phase.loads)
                done = aim if parts == 1.0 else done + dt
                pace[0] = next_pace(pace[0], dt, factor)
                work.rounded[0] += error > 1.0
                begun, sigma, tries = False, least_sigma(phase), 0
                expected, longer = LEAP * max(coarse, 1.0), dt
            else:
                before, longer, expected = fine, dt, coarse
                begun = result == OK
                tries += 1
                pace[0] = factor * dt
                refused += result == NOT_CLOSED and work.crossing[1] > 0.0
                if refused > REFUSED:
                    break
                if pace[0] < (ENDED if result == JAMMED else SHORTEST) * h:
                    if result != OK:
                        break
                    pace[0], trial = BEYOND * h, True
                if not begun:
                    copy(phase.q, work.q)
                    linearise(unit, system, work, work.q)
        if done < h:
            restore_grid_point(problem, phase)
            pace[0] = good_pace
            return result, taken, most
        save_grid_point(problem, phase)
        phase.step[0] = first + taken + 1
        leave_trail(work.trail, phase)
        good_pace = pace[0]
        if may_have_passed(problem, phase, end):
            return OK, taken + 1, most  # to be looked at
    return OK, steps, most

"""Steps of one length, many in one call."""

from __future__ import annotations

from alf_ros.kernel.companion import (
    BEGIN_CALL,
    END_STEP,
    is_accompanied,
    part_to_kink,
    tell,
)
from alf_ros.kernel.crossed_kinks import across_kinks, next_aim, passed, shorter
from alf_ros.kernel.data import Phase, Problem, Span
from alf_ros.kernel.grazed_kinks import UNFOUND, unresolved_kink
from alf_ros.kernel.kinks_over_time import end_of_drives, just_behind, piece_to_kink
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.singularity_monitor import may_have_passed
from alf_ros.kernel.status import FORCE_JUMPS, NOT_POSITIVE, OK, STOPPED
from alf_ros.kernel.step import (
    accept,
    least_sigma,
    linearise_first,
    note_leap,
    restore_grid_point,
    save_grid_point,
    step,
)
from alf_ros.kernel.step_error import judge
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.trail import leave_trail
from alf_ros.kernel.work_ledger import ALL_FORCES, record_power

PIECES = 50  # of a step, at most


@compiled
def advance(problem: Problem, phase: Phase, span: Span, within: bool) -> tuple[int, int, int]:
    """Take the steps of a span; returns (result, taken, most iterations).

    `phase` is the state, in and out; on failure it holds the last good step. The call ends earlier
    after a step in which, in a watched run, a singular position may have been passed.
    `within`: `phase` is a singular position, and no force acts along the direction of the lost
    row, so that solves do not show it. A step that is asked to stop is given up. A step is taken
    in pieces if a kink over time is in it (`kinks_over_time`), or a kink of a force that is met
    and left, which no stage may see (`grazed_kinks`); with derivatives also if a kink is crossed
    (`crossed_kinks`).
    """
    unit, system, work = problem.unit, problem.system, problem.work
    t0, first, steps, h = span
    most, kinks = 0, problem.forces.kinks
    if not linearise_first(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    tell(problem, phase, BEGIN_CALL, 0, t0, 0.0)
    sigma = 0.0 if within else least_sigma(phase)
    for taken in range(steps):
        t, end = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        done, aim, tries, begun = 0.0, h, 0, False  # aim: where the piece of the step ends
        since, cuts = 0.0, 0  # s since a kink was crossed; pieces on the way to crossings
        while True:
            begin, to, aim = piece_to_kink(kinks.instants, t, end, h, done, aim)
            dt = aim - done
            piece = just_behind(begin, to), to, dt, end_of_drives(to, end, aim == h)
            result, count = step(problem, phase, piece, sigma, begun)
            most = max(most, count)
            if told_to_stop(work):
                result = STOPPED
            if result == OK and kinks.search.size > 0:
                part = unresolved_kink(problem, phase, begin, dt)
                if part < 1.0 and tries < PIECES:  # a kink is met and left: the piece ends between
                    aim, tries, begun = done + part * dt, tries + 1, True
                    continue
                if part < 1.0:
                    kinks.near[0] = UNFOUND
            if result == OK and is_accompanied(problem):
                across = across_kinks(cuts, h)
                part = part_to_kink(problem, phase, begin, dt, h, across)
                length = shorter(part, dt, across)
                if length < dt:
                    aim, cuts, begun = done + length, cuts + 1, True
                    continue
                since = passed(since, part, dt)
                if part < 0.0:
                    result = FORCE_JUMPS
            if result == OK:
                near = kinks.near[0] if kinks.search.size > 0 else 0.0
                result = judge(unit, system, problem.method, work, dt, h, near)
            if result == OK:
                if done == 0.0 and aim < h:
                    save_grid_point(problem, phase)
                result = tell(problem, phase, END_STEP, 0, begin, sigma)
            if result != OK:
                if done > 0.0:
                    restore_grid_point(problem, phase)
                return result, taken, most
            record_power(problem, phase, begin, problem.method.b.size, dt, ALL_FORCES)
            note_leap(system, work, phase, dt)
            accept(unit, system, work, phase)
            copy(problem.forces.bearings.force, phase.loads)
            sigma = least_sigma(phase)
            if aim == h:
                break
            done, aim, begun = aim, next_aim(aim, since, h), False
        phase.step[0] = first + taken + 1
        leave_trail(work.trail, phase)
        if may_have_passed(problem, phase, end):
            return OK, taken + 1, most
    return OK, steps, most

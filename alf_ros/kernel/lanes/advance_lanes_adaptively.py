"""Steps of a group with an adaptive method: each lane with lengths of its own.

Lanes stand at different times, also within a step of the grid: some repeat a step that was too
long while others continue. A lane that leaves goes back to the last point of the grid, where the
state of its member stands, and the kernel of a single mechanism takes the whole step of the grid.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.kernel.arc_coordinates import turning
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneGroups, LaneProgress
from alf_ros.kernel.lanes.lane_group import (
    accept_lanes,
    advance_alone,
    begin_group,
    leave_aside,
    take_members,
)
from alf_ros.kernel.lanes.lane_judge import lane_errors
from alf_ros.kernel.lanes.lane_kinks import clear_of_kinks, end_at_instants
from alf_ros.kernel.lanes.lane_solve import are_factored
from alf_ros.kernel.lanes.lane_step import LaneSpan, lane_step_again
from alf_ros.kernel.lanes.single_member import give_phase
from alf_ros.kernel.lanes.waiting_members import next_waiting, take_waiting
from alf_ros.kernel.numba_ext.jit import ONE, ZERO, compiled, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.lane_structs import lane, set_lane, struct_at
from alf_ros.kernel.status import STOPPED
from alf_ros.kernel.step_length import (
    LEAP,
    MOST,
    SHARE,
    SHORTEST,
    TURN,
    Last,
    judged,
    likely_rounding,
    next_pace,
    parts_of,
)
from alf_ros.kernel.stopping import told_to_stop

Mask = Any


@compiled
def advance_lanes_adaptively(
    problem: Problem,
    phase: Phase,
    progress: LaneProgress,
    crew: LaneCrew,
    of: Problem,
    of_phase: Phase,
    groups: LaneGroups,
    h: float,
) -> int:
    """`advance_lanes`, each h in as many steps as the tolerance of the method takes. Members may
    change places with members of later groups of one kind."""
    for g in range(ZERO, np.uint64(groups.crew.size)):
        done = _advance(
            struct_at(problem, groups.problem[g]),
            struct_at(phase, groups.phase[g]),
            struct_at(progress, groups.progress[g]),
            struct_at(crew, groups.crew[g]),
            of,
            of_phase,
            (groups, g),
            h,
        )
        if not done:
            return np.int64(g)
    return -1


@inner
def _advance(
    problem: Problem,
    phase: Phase,
    progress: LaneProgress,
    crew: LaneCrew,
    of: Problem,
    of_phase: Phase,
    among: tuple[LaneGroups, np.uint64],
    h: float,
) -> bool:
    """The same of one group `among` all, its number behind them; returns whether it was not
    stopped. Variables have the names of `advance_adaptively`."""
    groups, g = among
    unit, method, work = problem.unit, problem.method, problem.work
    members, share, stages = np.uint64(crew.problem.size), SHARE * method.tolerance, method.b.size
    waiting, places = (g + ONE) * members, np.uint64(groups.crew.size) * members
    live = progress.index[0] < progress.target[0]
    if nowhere(live):
        return True
    take_members(problem, phase, progress, crew, of, of_phase)
    for m in range(ZERO, members):
        struct_at(of, crew.problem[m]).work.crossing[ONE] = 0.0
    begun = live & unless(live)
    done = tried = tries = rounded = evaluations = pick(live, 0.0, 0.0)
    floor, longer = done + 1.0, done + h
    before = expected = done + np.inf
    progress.more[0] = done
    fresh, stopped = False, False
    while True:
        # members may have changed places: what is constant in `problem` is that in one step only
        problem = struct_at(problem, groups.problem[g])
        system, index, pace = problem.system, progress.index[0], phase.pace[0]
        live = index < progress.target[0]
        if nowhere(live):
            break
        stopped = told_to_stop(work)
        if stopped:
            break
        if not fresh:
            begin_group(problem, phase, of, crew)
            fresh = True
        tried += 1.0
        progress.begin[0], progress.left[0] = index * h + done, h - done
        progress.end[0] = done + np.inf
        if crew.dated[0] != 0:
            end_at_instants(of, crew, progress, h)
        t, left = progress.begin[0], progress.left[0]
        to_grid = unless(left < h - done)
        longest = pick(begun, pace, min(pace, TURN / turning(unit, system.arms, phase)))
        parts = parts_of(left, longest)
        dt, whole = left / parts, parts == 1.0
        grid = (index + 1.0) * h
        end = min(pick(whole & to_grid, grid, t + dt), progress.end[0])
        span = LaneSpan(t, end, dt, pick(whole & to_grid, grid, end))
        # also if it is not known whether the position is a singular one
        good = live & (phase.within[0] <= 0.0) & are_factored(unit, work) & (tried <= MOST)
        fine = coarse = done
        if anywhere(good):
            _begin_sides(of, crew, progress, begun)
            good, most = lane_step_again(problem, phase, of, crew, progress, span, good, begun)
            progress.most[0] = pick(good, max(most, progress.most[0]), progress.most[0])
            fine, coarse = lane_errors(unit, system, method, work, phase, dt, share, good)
            good = good & (fine < np.inf) & (coarse < np.inf)
            _note_sides(of, crew, progress)
        likely, across = likely_rounding(system, np.inf), progress.across[0] > 0.0
        last = Last(expected, before, tries, dt / longer)
        error, factor, floor = judged(fine, coarse, share, likely, across, floor, last)
        accepted = good & (error <= floor)
        if anywhere(accepted):
            clear = clear_of_kinks(problem, phase, of, crew, progress, t, dt, accepted)
            good = good & unless(accepted & unless(clear))
            accepted = clear
        refused = good & unless(accepted)
        leaving = live & unless(good)
        leaving = leaving | (refused & (factor * dt < SHORTEST * h))
        if anywhere(accepted):
            accept_lanes(problem, phase, of, crew, dt, accepted)
        evaluations += pick(begun, stages - 1.0, stages)
        rounded += pick(accepted & (error > 1.0), 1.0, 0.0)
        phase.pace[0] = pick(accepted, next_pace(pace, dt, factor), factor * dt)
        done = pick(accepted, pick(whole & to_grid, h, done + dt), done)
        expected = pick(accepted, LEAP * max(coarse, 1.0), coarse)
        before, longer, begun = fine, dt, refused & unless(leaving)
        tries = pick(begun, tries + 1.0, 0.0)
        arrived = accepted & unless(done < h)
        if anywhere(arrived):
            progress.index[0] += pick(arrived, 1.0, 0.0)
            progress.t[0] = pick(arrived, evaluations + progress.more[0], 0.0)
            progress.across[0] = rounded
            for m in range(ZERO, members):
                if lane(progress.t, ZERO, m) > 0.0:
                    member = struct_at(of, crew.problem[m])
                    give_phase(phase, work, struct_at(of_phase, crew.phase[m]), member, m)
                    leave_aside(of, crew, m)
                    member.work.evaluations[0] += np.int64(lane(progress.t, ZERO, m))
                    member.work.rounded[0] += np.int64(lane(progress.across, ZERO, m))
        if anywhere(leaving):
            progress.t[0] = pick(leaving, 1.0, 0.0)
            for m in range(ZERO, members):
                if not stopped and lane(progress.t, ZERO, m) > 0.0:
                    advance_alone(problem, phase, of, of_phase, crew, progress, h, m)
                    stopped = crew.result[m] == STOPPED
            if stopped:
                break
            fresh = False
        idle = (arrived | leaving) & unless(progress.index[0] < progress.target[0])
        if waiting < places and anywhere(idle):
            progress.t[0] = pick(idle, 1.0, 0.0)
            for m in range(ZERO, members):
                if lane(progress.t, ZERO, m) > 0.0:
                    waiting = next_waiting(progress, crew, groups, waiting)
                    if waiting < places:
                        take_waiting(
                            problem, phase, progress, crew, of, of_phase, groups, (m, waiting)
                        )
                        struct_at(of, crew.problem[m]).work.crossing[ONE] = 0.0
                        fresh = False
        anew = arrived | leaving  # at a point of the grid
        if anywhere(anew):
            done, tried = pick(anew, 0.0, done), pick(anew, 0.0, tried)
            rounded, evaluations = pick(anew, 0.0, rounded), pick(anew, 0.0, evaluations)
            progress.more[0] = pick(anew, 0.0, progress.more[0])
            floor, expected = pick(anew, 1.0, floor), pick(anew, np.inf, expected)
    for m in range(ZERO, members):
        state = struct_at(of_phase, crew.phase[m])
        state.step[0] = np.int64(lane(progress.index, ZERO, m))
    return not stopped


@inner
def _begin_sides(of: Problem, crew: LaneCrew, progress: LaneProgress, begun: Mask) -> None:
    """Before a step: sides of kinks are known where the last step began at the same state."""
    progress.across[0] = pick(begun, 1.0, 0.0)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        sides = struct_at(of, crew.problem[m]).work.sides
        if lane(progress.across, ZERO, m) == 0.0:
            sides[ZERO] = np.nan
        sides[ONE] = 0.0


@inner
def _note_sides(of: Problem, crew: LaneCrew, progress: LaneProgress) -> None:
    """The members whose forces have met a kink in the step."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        set_lane(progress.across, ZERO, m, struct_at(of, crew.problem[m]).work.sides[ONE])

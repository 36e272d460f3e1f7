"""Steps of a group, until each member has made its own."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneGroups, LaneProgress
from alf_ros.kernel.lanes.lane_group import (
    accept_lanes,
    advance_alone,
    begin_group,
    leave_aside,
    take_members,
)
from alf_ros.kernel.lanes.lane_kinks import clear_of_instants
from alf_ros.kernel.lanes.lane_solve import are_factored
from alf_ros.kernel.lanes.lane_step import lane_step
from alf_ros.kernel.lanes.single_member import count_stages, give_phase
from alf_ros.kernel.numba_ext.jit import ZERO, compiled, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.lane_structs import lane, struct_at
from alf_ros.kernel.status import STOPPED
from alf_ros.kernel.stopping import told_to_stop


@compiled
def advance_lanes(
    problem: Problem,
    phase: Phase,
    progress: LaneProgress,
    crew: LaneCrew,
    of: Problem,
    of_phase: Phase,
    groups: LaneGroups,
    h: float,
) -> int:
    """Take steps of h (s), group by group, until the index of each member is its target, or one of
    its steps has failed.

    `problem`, `phase`, `progress` and `crew` are of any group, `of` and `of_phase` of any member.
    States are read from the members and given back to them. Returns -1, or the number of the group
    that was stopped.
    """
    for g in range(ZERO, np.uint64(groups.crew.size)):
        done = _advance(
            struct_at(problem, groups.problem[g]),
            struct_at(phase, groups.phase[g]),
            struct_at(progress, groups.progress[g]),
            struct_at(crew, groups.crew[g]),
            of,
            of_phase,
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
    h: float,
) -> bool:
    """The same of one group; returns whether it was not stopped."""
    unit, work = problem.unit, problem.work
    members = np.uint64(crew.problem.size)
    take_members(problem, phase, progress, crew, of, of_phase)
    fresh, stopped = False, False
    ordinary = progress.index[0] < progress.index[0]  # the last step
    progress.more[0] = pick(ordinary, 1.0, 0.0)
    while True:
        live = progress.index[0] < progress.target[0]
        if nowhere(live):
            break
        stopped = told_to_stop(work)
        if stopped:
            break
        if not fresh:
            begin_group(problem, phase, of, crew)
            fresh = True
        # also if it is not known whether the position is a singular one
        good = live & (phase.within[0] <= 0.0) & are_factored(unit, work)
        index = progress.index[0]
        progress.begin[0], progress.end[0] = index * h, (index + 1.0) * h
        if crew.dated[0] != 0:
            good = good & clear_of_instants(of, crew, progress, h)
        if anywhere(good):
            good, most = lane_step(problem, phase, of, crew, progress, h, good)
            progress.most[0] = pick(good, max(most, progress.most[0]), progress.most[0])
            accept_lanes(problem, phase, of, crew, h, good)
            progress.index[0] += pick(good, 1.0, 0.0)
            if anywhere(progress.more[0] > 0.0):
                count_stages(of, crew, progress, good)
        leaving = live & unless(good)
        ordinary = (ordinary | good) & unless(leaving)
        if anywhere(leaving):
            progress.t[0] = pick(leaving, 1.0, 0.0)
            for m in range(ZERO, members):
                if not stopped and lane(progress.t, ZERO, m) > 0.0:
                    member = struct_at(of, crew.problem[m])
                    give_phase(phase, work, struct_at(of_phase, crew.phase[m]), member, m)
                    advance_alone(problem, phase, of, of_phase, crew, progress, h, m)
                    stopped = crew.result[m] == STOPPED
            if stopped:
                break
            fresh = False
    progress.t[0] = pick(ordinary, 1.0, 0.0)
    for m in range(ZERO, members):
        member = struct_at(of, crew.problem[m])
        state = struct_at(of_phase, crew.phase[m])
        give_phase(phase, work, state, member, m)
        if lane(progress.t, ZERO, m) > 0.0:
            leave_aside(of, crew, m)
        state.step[0] = np.int64(lane(progress.index, ZERO, m))
    return not stopped

"""Steps of a group, until each member has made its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.kernel.constraints import violation
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneGroups, LaneProgress
from alf_ros.kernel.lanes.lane_solve import are_factored
from alf_ros.kernel.lanes.lane_step import lane_step
from alf_ros.kernel.lanes.single_member import (
    give_phase,
    put_lane,
    steady_forces,
    take_phase,
)
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import begin_with_det, note_det
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ZERO, compiled, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.lane_structs import lane, set_lane, struct_at
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.slip import begin_slips
from alf_ros.kernel.status import OK, STOPPED
from alf_ros.kernel.step import store_angles
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.unwrapping import count_turns, nearby

Mask = Any

_ALONE = 8.0  # steps of a member that left, before it comes back


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
    for m in range(ZERO, members):
        member = struct_at(of, crew.problem[m])
        state = struct_at(of_phase, crew.phase[m])
        take_phase(phase, work, state, member, m)
        set_lane(progress.index, ZERO, m, float(state.step[0]))
    fresh, stopped = False, False
    while True:
        live = progress.index[0] < progress.target[0]
        if nowhere(live):
            break
        stopped = told_to_stop(work)
        if stopped:
            break
        if not fresh:
            _begin(problem, phase, of, crew)
            fresh = True
        # also if it is not known whether the position is a singular one
        ordinary = live & (phase.within[0] <= 0.0) & are_factored(unit, work)
        good = ordinary
        if anywhere(ordinary):
            good, most = lane_step(problem, phase, of, crew, progress, h, ordinary)
            progress.most[0] = pick(good, max(most, progress.most[0]), progress.most[0])
            _accept(problem, phase, of, crew, good)
            progress.index[0] += pick(good, 1.0, 0.0)
        leaving = pick(live & unless(good), 1.0, 0.0)
        if anywhere(leaving > 0.0):
            progress.t[0] = leaving
            for m in range(ZERO, members):
                if not stopped and lane(progress.t, ZERO, m) > 0.0:
                    _advance_alone(problem, phase, of, of_phase, crew, progress, h, m)
                    stopped = crew.result[m] == STOPPED
            if stopped:
                break
            fresh = False
    for m in range(ZERO, members):
        member = struct_at(of, crew.problem[m])
        state = struct_at(of_phase, crew.phase[m])
        give_phase(phase, work, state, member, m)
        state.step[0] = np.int64(lane(progress.index, ZERO, m))
    return not stopped


@inner
def _begin(problem: Problem, phase: Phase, of: Problem, crew: LaneCrew) -> None:
    """Φ_q, factor and angles of the phases."""
    unit, system, work = problem.unit, problem.system, problem.work
    store_angles(unit, system, work, phase)
    copy(phase.q, work.q)
    linearise(unit, system, work, work.q)
    note_det(unit, work)
    begin_with_det(work)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m]).work
        whole = np.uint64(member.q.size)
        put_lane(work.near, member.near, np.uint64(member.near.size), m)
        put_lane(phase.q, member.q, whole, m)
        put_lane(phase.qd, member.qd, whole, m)
    if crew.steady[0] != 0:
        steady_forces(problem, of, crew)


@inner
def _accept(problem: Problem, phase: Phase, of: Problem, crew: LaneCrew, good: Mask) -> None:
    """Take the ends of the steps of the lanes where `good` holds as their new phases."""
    unit, system, work = problem.unit, problem.system, problem.work
    for i in range(phase.q.size):
        phase.q[i] = pick(good, work.q[i], phase.q[i])
        phase.qd[i] = pick(good, work.qd[i], phase.qd[i])
    phase.within[0] = pick(good, 0.0, phase.within[0])
    begin_with_det(work)
    angles = np.uint64(work.near.size)
    if angles == ZERO:
        return
    violation(unit, system.angles, work.q, work.angle)
    for i in range(work.angle.size):
        work.angle[i] = pick(good, work.angle[i], work.angle_before[i])
    count_turns(work.angle_before, work.angle, phase.turns)
    copy(work.angle, work.angle_before)
    nearby(work.angle, phase.turns, work.near)
    begin_slips(unit, system, work, phase)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        put_lane(work.near, struct_at(of, crew.problem[m]).work.near, angles, m)


@inner
def _advance_alone(
    problem: Problem,
    phase: Phase,
    of: Problem,
    of_phase: Phase,
    crew: LaneCrew,
    progress: LaneProgress,
    h: float,
    m: np.uint64,
) -> None:
    """Some steps of the member in lane m by the kernel of a single mechanism."""
    member = struct_at(of, crew.problem[m])
    state = struct_at(of_phase, crew.phase[m])
    give_phase(phase, problem.work, state, member, m)
    index, target = lane(progress.index, ZERO, m), lane(progress.target, ZERO, m)
    state.step[0] = np.int64(index)
    steps = np.int64(min(_ALONE, target - index))
    call(crew.alone[0], member, state, h, steps, crew.told)
    take_phase(phase, problem.work, state, member, m)
    index += crew.told[1]
    set_lane(progress.index, ZERO, m, index)
    set_lane(progress.most, ZERO, m, max(lane(progress.most, ZERO, m), crew.told[2]))
    crew.apart[m] += np.int64(crew.told[1])
    crew.result[m] = np.int64(crew.told[0])
    if crew.result[m] != OK:
        set_lane(progress.target, ZERO, m, index)

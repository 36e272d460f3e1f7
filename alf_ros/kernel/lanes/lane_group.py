"""The states of a group between steps: taken from the members, accepted, left to one of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.kernel.constraints import violation
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneProgress
from alf_ros.kernel.lanes.single_member import (
    put_lane,
    steady_forces,
    step_alone,
    take_params,
    take_phase,
)
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import begin_with_det, note_det, note_way
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, inner
from alf_ros.kernel.numba_ext.lane_numbers import pick
from alf_ros.kernel.numba_ext.lane_structs import lane, set_lane, struct_at
from alf_ros.kernel.numba_ext.vectors import copy, largest
from alf_ros.kernel.slip import begin_slips
from alf_ros.kernel.status import OK
from alf_ros.kernel.step import store_angles
from alf_ros.kernel.unwrapping import count_turns, nearby

Lanes = Any
Mask = Any


@inner
def take_members(
    problem: Problem,
    phase: Phase,
    progress: LaneProgress,
    crew: LaneCrew,
    of: Problem,
    of_phase: Phase,
) -> None:
    """States, judgements, numbers of steps and of effects of the members."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        state = struct_at(of_phase, crew.phase[m])
        take_phase(phase, problem.work, state, member, m)
        set_lane(progress.index, ZERO, m, float(state.step[0]))
    take_params(of, crew)


@inner
def begin_group(problem: Problem, phase: Phase, of: Problem, crew: LaneCrew) -> None:
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
def accept_lanes(
    problem: Problem, phase: Phase, of: Problem, crew: LaneCrew, h: Lanes, good: Mask
) -> None:
    """Take the ends of the steps of h (s) of the lanes where `good` holds as their new phases."""
    unit, system, work = problem.unit, problem.system, problem.work
    note_way(work, h * largest(phase.qd, work.p.size), good)
    for i in range(phase.q.size):
        phase.q[i] = pick(good, work.q[i], phase.q[i])
        phase.qd[i] = pick(good, work.qd[i], phase.qd[i])
    phase.within[0] = pick(good, 0.0, phase.within[0])
    for i in range(ZERO, TWO):
        work.inverse_det[i] = pick(good, work.inverse_det[TWO + i], work.inverse_det[i])
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
def advance_alone(
    problem: Problem,
    phase: Phase,
    of: Problem,
    of_phase: Phase,
    crew: LaneCrew,
    progress: LaneProgress,
    h: float,
    m: np.uint64,
) -> None:
    """Steps of the member in lane m, from the state that it has itself, by the kernel of a single
    mechanism, until it is clear of singular positions."""
    member = struct_at(of, crew.problem[m])
    state = struct_at(of_phase, crew.phase[m])
    index, target = lane(progress.index, ZERO, m), lane(progress.target, ZERO, m)
    state.step[0] = np.int64(index)
    while True:
        result, taken, most = step_alone(crew.alone[0], member, state, h)
        index += taken
        set_lane(progress.most, ZERO, m, max(lane(progress.most, ZERO, m), float(most)))
        crew.apart[m] += taken
        crew.result[m] = result
        if crew.result[m] != OK or index >= target or not member.work.nearest[0] < np.inf:
            break
    take_phase(phase, problem.work, state, member, m)
    set_lane(progress.index, ZERO, m, index)
    if crew.result[m] != OK:
        set_lane(progress.target, ZERO, m, index)


@inner
def leave_aside(of: Problem, crew: LaneCrew, m: np.uint64) -> None:
    """The last step of the member in lane m was an ordinary one."""
    aside = struct_at(of, crew.problem[m]).work.aside
    aside[ZERO], aside[ONE] = 0, 0

"""One step of a group: `step.step`, of lanes that are far from singular positions."""

from __future__ import annotations

from typing import Any

from alf_ros.kernel.arc_coordinates import (
    begin_momenta,
    choose_arcs,
    fold,
    shift_along_path,
    unfold,
)
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneProgress
from alf_ros.kernel.lanes.lane_judge import judge_lanes
from alf_ros.kernel.lanes.lane_projection import project_lanes
from alf_ros.kernel.lanes.lane_solve import (
    are_factored,
    lane_accelerations,
    lane_velocities,
    path_curvature,
)
from alf_ros.kernel.lanes.single_member import lane_drives, lane_forces
from alf_ros.kernel.ldl import assemble, linearise, solve_on
from alf_ros.kernel.lost_rank import fallen, note_det
from alf_ros.kernel.numba_ext.jit import ONE, ZERO, inner
from alf_ros.kernel.numba_ext.lane_numbers import nowhere, unless
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.projection import begin_correction
from alf_ros.kernel.step import add_up, lag_of_stage

Lanes = Any
Mask = Any


@inner
def lane_step(
    problem: Problem,
    phase: Phase,
    of: Problem,
    crew: LaneCrew,
    progress: LaneProgress,
    h: float,
    live: Mask,
) -> tuple[Mask, Lanes]:
    """One step of h (s) of the lanes where `live` holds, from q, q̇ of `phase`, whose Φ_q and
    factor stand in `work`. `of`: any member of the crew.

    Leaves the new q, q̇ in `work`, with Φ_q and factor. Returns the lanes that have made it, and
    the most iterations of each. The others are as they were.
    """
    unit, system, method, work = problem.unit, problem.system, problem.method, problem.work
    stages, index, t = method.b.size, progress.index[0], progress.t
    begin = index * h
    t[0] = begin
    copy(phase.qd, work.qd)
    lane_drives(problem, of, crew, progress)
    lane_forces(problem, of, crew, progress)
    most, good = lane_accelerations(problem, live)  # (26)
    path_curvature(problem, good)
    begin_momenta(unit, system, work, phase, choose_arcs(unit, system, work, phase, h))
    for s in range(ZERO, stages + ONE):
        add_up(method, work, s, h)
        t[0] = begin + method.c[s] * h if s < stages else (index + 1.0) * h
        lane_drives(problem, of, crew, progress)
        unfold(unit, system, work, phase)  # (30)
        if s == stages or nowhere(good):
            break
        if s > ZERO:
            copy(work.q, work.target)
            shift_along_path(unit, system.arms, work, h * h * lag_of_stage(method, s))
            rounds, good = _stage(problem, of, crew, progress, good)
            most = max(most, rounds)
        fold(unit, system, work, work.qd, work.qdd, s)  # (35)
    if nowhere(good):
        return good, most
    rounds, good = _end(problem, good)
    good = judge_lanes(unit, system, method, work, h, good)
    return good, max(most, rounds)


@inner
def _stage(
    problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress, good: Mask
) -> tuple[Lanes, Mask]:
    """q̇ and q̈ of a stage from q and p' in `work`; returns the rounds and the lanes where the
    stage is far from singular positions."""
    unit, system, work = problem.unit, problem.system, problem.work
    assemble(unit, system, work, work.q)
    begin_correction(unit, system, work)
    solve_on(unit, system, work)
    good = good & are_factored(unit, work)
    for a in range(work.p.size):
        work.q[a] = work.target[a] + work.delta[a]
    rounds, good = lane_velocities(problem, good)  # (33)
    lane_forces(problem, of, crew, progress)
    more, good = lane_accelerations(problem, good)  # (26)
    return max(rounds, more), good


@inner
def _end(problem: Problem, good: Mask) -> tuple[Lanes, Mask]:
    """The end of a step, q and p' in `work`, onto Φ = 0, with Φ_q and factor, and q̇; returns what
    `_stage` does."""
    unit, system, work = problem.unit, problem.system, problem.work
    good = project_lanes(unit, system, work, good)
    linearise(unit, system, work, work.q)
    note_det(unit, work)
    good = good & are_factored(unit, work) & unless(fallen(work))
    rounds, good = lane_velocities(problem, good)  # (33)
    check = 0.0
    for i in range(work.p.size):
        check += work.q[i] + work.qd[i]
    return rounds, good & (check - check == 0.0)

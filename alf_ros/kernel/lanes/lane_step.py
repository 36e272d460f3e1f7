"""One step of a group: `step.step`, of lanes that are far from singular positions."""

from __future__ import annotations

from typing import Any, NamedTuple

from alf_ros.kernel.arc_coordinates import (
    begin_momenta,
    choose_arcs,
    fold,
    shift_along_path,
    unfold,
)
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneProgress
from alf_ros.kernel.kinks_over_time import just_behind, stage_time
from alf_ros.kernel.lanes.lane_judge import judge_lanes
from alf_ros.kernel.lanes.lane_kinks import clear_of_kinks
from alf_ros.kernel.lanes.lane_projection import project_lanes
from alf_ros.kernel.lanes.lane_solve import (
    are_factored,
    lane_accelerations,
    lane_velocities,
    path_curvature,
)
from alf_ros.kernel.lanes.single_member import evaluated_alone, lane_drives, lane_forces
from alf_ros.kernel.ldl import assemble, linearise, solve_on
from alf_ros.kernel.lost_rank import fallen, note_det, rank_lost
from alf_ros.kernel.numba_ext.jit import ONE, ZERO, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.vectors import copy, put_sum
from alf_ros.kernel.projection import begin_correction
from alf_ros.kernel.step import add_up

Lanes = Any
Mask = Any


class LaneSpan(NamedTuple):
    """A step of h (s) from `begin` to `end` (s), of each lane; `there`: the time (s) of the drives
    where it ends."""

    begin: Lanes
    end: Lanes
    h: Lanes
    there: Lanes


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
    """One step of h (s) of the lanes where `live` holds, between the times in `progress`, from q,
    q̇ of `phase`, whose Φ_q and factor stand in `work`. `of`: any member of the crew.

    Leaves the new q, q̇ in `work`, with Φ_q and factor. Returns the lanes that have made it, and
    the most iterations of each. The others are as they were.
    """
    work, begin, end = problem.work, progress.begin[0], progress.end[0]
    span = LaneSpan(just_behind(begin, end), end, h, (progress.index[0] + 1.0) * h)
    progress.t[0] = span.begin
    copy(phase.qd, work.qd)
    lane_drives(problem, of, crew, progress)
    lane_forces(problem, of, crew, progress)
    most, good = lane_accelerations(problem, live)  # (26)
    if len(problem.unit) != 2:  # in the plane nothing asks for it
        copy(work.qdd, work.pull)
    path_curvature(problem, good)
    good, rounds = stages_of(problem, phase, of, crew, progress, span, good, None)
    good = clear_of_kinks(problem, phase, of, crew, progress, begin, h, good)
    good = judge_lanes(problem.unit, problem.system, problem.method, work, h, good)
    return good, max(most, rounds)


@inner
def lane_step_again(
    problem: Problem,
    phase: Phase,
    of: Problem,
    crew: LaneCrew,
    progress: LaneProgress,
    span: LaneSpan,
    live: Mask,
    begun: Mask,
) -> tuple[Mask, Lanes]:
    """`lane_step` over a span of each lane, not judged. Where `begun` holds the last step was too
    long: its first stage is kept, and Φ_q and factor need not belong to `phase`."""
    work = problem.work
    progress.t[0] = span.begin
    copy(phase.q, work.q)
    copy(phase.qd, work.qd)
    lane_drives(problem, of, crew, progress)
    most, good, fresh = pick(begun, 1.0, 1.0), live, live & unless(begun)
    if not nowhere(fresh):
        lane_forces(problem, of, crew, progress)
        for i in range(work.curve.size):
            work.curve[i] = work.bend[i]
        rounds, factored = lane_accelerations(problem, fresh)  # (26)
        if len(problem.unit) != 2:
            for i in range(work.pull.size):
                work.pull[i] = pick(begun, work.pull[i], work.qdd[i])
        path_curvature(problem, factored)
        for i in range(work.curve.size):
            work.bend[i] = pick(begun, work.curve[i], work.bend[i])
        most, good = pick(begun, most, rounds), factored | (live & begun)
    good, rounds = stages_of(problem, phase, of, crew, progress, span, good, begun)
    return good, max(most, rounds)


@inner
def stages_of(
    problem: Problem,
    phase: Phase,
    of: Problem,
    crew: LaneCrew,
    progress: LaneProgress,
    span: LaneSpan,
    good: Mask,
    begun: Mask | None,
) -> tuple[Mask, Lanes]:
    """The stages and the end of a step, from q̈ where it begins and the curvature of the path.

    `begun`: where the first stage is kept in `chart.first`; None without code for it.
    """
    unit, system, method, work = problem.unit, problem.system, problem.method, problem.work
    stages, t, h, chart = method.b.size, progress.t, span.h, problem.work.chart
    most = pick(good, 1.0, 1.0)
    begin_momenta(unit, system, work, phase, choose_arcs(unit, system, work, phase, h))
    for s in range(ZERO, stages + ONE):
        add_up(method, work, s, h)
        t[0] = stage_time(span.begin, span.end, h, method.c[s]) if s < stages else span.there
        lane_drives(problem, of, crew, progress)
        unfold(unit, system, work, phase)  # (30)
        if s == stages or nowhere(good):
            break
        if s > ZERO:
            shift_along_path(unit, system.arms, work, h * h * method.lag[s])
            rounds, good = _stage(problem, of, crew, progress, good)
            most = max(most, rounds)
        elif begun is not None:  # known when it is compiled
            for i in range(chart.first.size):
                chart.first[i] = pick(begun, chart.first[i], work.qdd[i])
                work.qdd[i] = chart.first[i]
                work.qd[i] = pick(begun, phase.qd[i], work.qd[i])
            for i in range(chart.w.size):
                chart.w[i] = pick(begun, chart.momentum[i], chart.w[i])
        fold(unit, system, work, work.qd, work.qdd, s)  # (35)
    if nowhere(good):
        return good, most
    rounds, good = _end(problem, good)
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
    put_sum(work.target, work.delta, work.q, work.p.size)
    rounds, good = lane_velocities(problem, good)  # (33)
    lane_forces(problem, of, crew, progress)
    more, fine = lane_accelerations(problem, good)  # (26)
    slow = good & unless(fine)
    if anywhere(slow):
        fine = fine | evaluated_alone(problem, of, crew, progress, slow)
    return max(rounds, more), fine


@inner
def _end(problem: Problem, good: Mask) -> tuple[Lanes, Mask]:
    """The end of a step, q and p' in `work`, onto Φ = 0, with Φ_q and factor, and q̇; returns what
    `_stage` does."""
    unit, system, work = problem.unit, problem.system, problem.work
    good = project_lanes(unit, system, work, good)
    linearise(unit, system, work, work.q)
    note_det(unit, work)
    good = good & are_factored(unit, work)
    fell = good & fallen(work)
    if anywhere(fell):
        good = good & unless(fell & rank_lost(unit, system, work))
    rounds, good = lane_velocities(problem, good)  # (33)
    check = 0.0
    for i in range(work.p.size):
        check += work.q[i] + work.qd[i]
    return rounds, good & (check - check == 0.0)

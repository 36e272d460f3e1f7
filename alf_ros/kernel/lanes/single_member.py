"""Tasks of a group that call functions of its members: forces, prescribed motions, steps alone.

Drives, and effects at which members part (`lane_force`), are functions of one mechanism, called by
their addresses. They read and write the workspace of the member itself. A member steps alone by
the machine code of a single run, which is called where it begins: it is not compiled again.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import typeof, types

from alf_ros.arrays import Addresses, Floats
from alf_ros.kernel.adaptive import advance_adaptively
from alf_ros.kernel.applied_forces import add_one
from alf_ros.kernel.augmented_solve import apply, note_side
from alf_ros.kernel.data import Phase, Problem, Scales, Span, Work
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneProgress
from alf_ros.kernel.fixed_steps import advance
from alf_ros.kernel.numba_ext.calls import call, call_for_counts, call_for_number, entry
from alf_ros.kernel.numba_ext.jit import TWO, ZERO, by_address, inner
from alf_ros.kernel.numba_ext.lane_numbers import pick
from alf_ros.kernel.numba_ext.lane_structs import lane, set_lane, struct_at
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage


@inner
def put_lane(of: Floats, to: Floats, n: np.uint64, m: np.uint64) -> None:
    """The first n numbers of lane m, to the numbers of a member."""
    for i in range(ZERO, n):
        to[i] = lane(of, i, m)


@inner
def take_lane(of: Floats, to: Floats, first: np.uint64, n: np.uint64, m: np.uint64) -> None:
    """The numbers of a member from the first on, before the n-th, into lane m."""
    for i in range(first, n):
        set_lane(to, i, m, of[i])


@inner
def lane_forces(problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress) -> None:
    """Q at q, q̇ of `problem`, in lanes, unless it is known. `of`: any member."""
    if crew.steady[0] != 0:
        return
    if crew.lane_force.size > 0:
        _forces_in_lanes(problem, of, crew, progress)
        return
    work = problem.work
    n, whole = np.uint64(work.p.size), np.uint64(work.q.size)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        put_lane(work.q, member.work.q, n, m)
        put_lane(work.qd, member.work.qd, n, m)
        call(crew.forces[0], member, lane(progress.t, ZERO, m))
        take_lane(member.work.Q, work.Q, ZERO, whole, m)


@inner
def _forces_in_lanes(
    problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress
) -> None:
    """The same, effect by effect: of all members at once, or where they part of one after
    another. All have the same effects."""
    work, effects = problem.work, struct_at(of, crew.problem[ZERO]).forces.effects
    lanes, given = np.uint64(crew.problem.size), False
    zero(work.Q)
    for e in range(ZERO, np.uint64(crew.lane_force.size)):
        if crew.lane_force[e] != 0:
            copy(work.Q, progress.Q)
            crew.parted[0] = 0
            call(
                crew.lane_force[e],
                progress.t,
                work.q,
                work.qd,
                work.near,
                effects.slots,
                effects.slots_at[e],
                crew.params,
                effects.params_at[e] * lanes,
                work.Q,
                crew.parted,
            )
            if crew.parted[0] == 0:
                continue
            copy(progress.Q, work.Q)
        _add_to_each(problem, of, crew, progress, e, given)
        given = True
    if effects.side.size > 0:
        _note_sides(problem, of, crew, progress, given)


@inner
def _add_to_each(
    problem: Problem,
    of: Problem,
    crew: LaneCrew,
    progress: LaneProgress,
    e: np.uint64,
    given: bool,
) -> None:
    """Q += the force of effect number e, member by member. `given`: they have q and q̇."""
    work, whole = problem.work, np.uint64(problem.work.q.size)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        _give(problem, member, m, given)
        put_lane(work.Q, member.work.Q, whole, m)
        call(crew.forces[1], member, e, lane(progress.t, ZERO, m))
        take_lane(member.work.Q, work.Q, ZERO, whole, m)


@inner
def _note_sides(
    problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress, given: bool
) -> None:
    """`note_side` of each member. `given`: they have q and q̇."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        _give(problem, member, m, given)
        call(crew.forces[2], member, lane(progress.t, ZERO, m))


@inner
def _give(problem: Problem, member: Problem, m: np.uint64, given: bool) -> None:
    """q and q̇ of lane m to its member, unless it has them."""
    n = np.uint64(problem.work.p.size)
    if not given:
        put_lane(problem.work.q, member.work.q, n, m)
        put_lane(problem.work.qd, member.work.qd, n, m)


@inner
def take_params(of: Problem, crew: LaneCrew) -> None:
    """The numbers of the effects of all members, if forces are computed in lanes."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        take_params_of(of, crew, m)


@inner
def take_params_of(of: Problem, crew: LaneCrew, m: np.uint64) -> None:
    """The same of the member in lane m."""
    if crew.lane_force.size == 0:
        return
    params, lanes = struct_at(of, crew.problem[m]).forces.effects.params, crew.problem.size
    for i in range(ZERO, np.uint64(params.size)):
        crew.params[i * np.uint64(lanes) + m] = params[i]


@inner
def steady_forces(problem: Problem, of: Problem, crew: LaneCrew) -> None:
    """Q that depends neither on time nor on the motion."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        call(crew.forces[0], member, 0.0)
        take_lane(member.work.Q, problem.work.Q, ZERO, np.uint64(member.work.Q.size), m)


@inner
def lane_drives(problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress) -> None:
    """Position, velocity and acceleration of prescribed blocks."""
    given, work = problem.system.prescribed, problem.work
    if given.program.size == 0:
        return
    if crew.lane_drives.size > 0:
        crew.parted[0] = 0
        call(
            crew.lane_drives[0],
            progress.t,
            given.slots,
            given.params,
            given.registers,
            work.q,
            work.qd,
            work.qdd,
            crew.parted,
        )
        if crew.parted[0] == 0:
            return
    n, whole = np.uint64(work.p.size), np.uint64(work.q.size)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        call(crew.drives[0], member, lane(progress.t, ZERO, m))
        take_lane(member.work.q, work.q, n, whole, m)
        take_lane(member.work.qd, work.qd, n, whole, m)
        take_lane(member.work.qdd, work.qdd, n, whole, m)


@inner
def give_phase(phase: Phase, work: Work, to: Phase, of: Problem, m: np.uint64) -> None:
    """State and judgement of lane m, to its member."""
    put_lane(phase.q, to.q, np.uint64(to.q.size), m)
    put_lane(phase.qd, to.qd, np.uint64(to.q.size), m)
    put_lane(phase.sums, to.sums, np.uint64(to.sums.size), m)
    put_lane(phase.within, to.within, np.uint64(1), m)
    put_lane(phase.pace, to.pace, np.uint64(1), m)
    put_lane(work.judged, of.work.judged, np.uint64(work.judged.size), m)
    put_lane(work.trend, of.work.trend, np.uint64(work.trend.size), m)
    for i in range(TWO, np.uint64(work.crossing.size)):
        of.work.crossing[i] = lane(work.crossing, i, m)
    for i in range(ZERO, np.uint64(to.turns.size)):
        to.turns[i] = np.int64(lane(phase.turns, i, m))


@inner
def take_phase(phase: Phase, work: Work, of: Phase, member: Problem, m: np.uint64) -> None:
    """The inverse of `give_phase`."""
    take_lane(of.q, phase.q, ZERO, np.uint64(of.q.size), m)
    take_lane(of.qd, phase.qd, ZERO, np.uint64(of.q.size), m)
    take_lane(of.sums, phase.sums, ZERO, np.uint64(of.sums.size), m)
    take_lane(of.within, phase.within, ZERO, np.uint64(1), m)
    take_lane(of.pace, phase.pace, ZERO, np.uint64(1), m)
    take_lane(member.work.judged, work.judged, ZERO, np.uint64(work.judged.size), m)
    take_lane(member.work.trend, work.trend, ZERO, np.uint64(work.trend.size), m)
    take_lane(member.work.crossing, work.crossing, TWO, np.uint64(work.crossing.size), m)
    for i in range(ZERO, np.uint64(of.turns.size)):
        set_lane(phase.turns, i, m, float(of.turns[i]))


def _apply(problem: Problem, t: float) -> None:
    apply(problem, t)


def _add_force(problem: Problem, e: int, t: float) -> None:
    work = problem.work
    add_one(problem.forces.effects, e, t, work.q, work.qd, work.near, work.Q)


def _note_side(problem: Problem, t: float) -> None:
    note_side(problem, t)


def _prescribe(problem: Problem, t: float) -> None:
    work = problem.work
    prescribe(problem.system, t, work.q, work.qd, work.qdd)


@inner
def evaluated_alone(
    problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress, slow: Any
) -> Any:
    """Evaluate a stage of the lanes where `slow` holds exactly: the kernel of a single mechanism
    does so where its accelerations were slow with the factor of a guess. Returns where that shows
    no singular position."""
    progress.alone[0] = pick(slow, 1.0, 0.0)
    work, system = problem.work, problem.system
    n, whole = np.uint64(work.p.size), np.uint64(work.q.size)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        if lane(progress.alone, ZERO, m) > 0.0:
            own = struct_at(of, crew.problem[m]).work
            put_lane(work.q, own.q, whole, m)
            put_lane(work.qd, own.qd, whole, m)
            put_lane(work.qdd, own.qdd, whole, m)
            put_lane(work.target, own.target, whole, m)
            put_lane(work.p, own.p, n, m)
            x = 0.0
            if system.integrals.row.size == ZERO:  # whose begin the member does not know
                x = call_for_number(
                    crew.stage[0], struct_at(of, crew.problem[m]), lane(progress.t, ZERO, m)
                )
                own.evaluations[0] -= 1  # it counts with the step
            if x < np.inf:
                set_lane(progress.alone, ZERO, m, 0.0)
                continue
            set_lane(progress.more, ZERO, m, lane(progress.more, ZERO, m) + 1.0)
            take_lane(own.q, work.q, ZERO, n, m)
            take_lane(own.qd, work.qd, ZERO, n, m)
            take_lane(own.qdd, work.qdd, ZERO, n, m)
            # the end of a step begins with the Φ_q and the factor of the last stage
            take_lane(own.g, work.g, ZERO, np.uint64(own.g.size), m)
            take_lane(own.g2, work.g2, ZERO, np.uint64(own.g2.size), m)
            take_lane(own.gf, work.gf, ZERO, np.uint64(own.gf.size), m)
            take_lane(own.g2f, work.g2f, ZERO, np.uint64(own.g2f.size), m)
            take_lane(own.diagonal, work.diagonal, ZERO, np.uint64(own.diagonal.size), m)
            take_lane(own.off, work.off, ZERO, np.uint64(own.off.size), m)
    return progress.alone[0] > 0.0


@inner
def count_stages(of: Problem, crew: LaneCrew, progress: LaneProgress, good: Any) -> None:
    """Count the stages that were evaluated alone where `good` holds, and forget all of them."""
    progress.alone[0] = pick(good, progress.more[0], 0.0)
    progress.more[0] = pick(good, 0.0, 0.0)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        evaluations = struct_at(of, crew.problem[m]).work.evaluations
        evaluations[0] += np.int64(lane(progress.alone, ZERO, m))


@inner
def step_alone(
    alone: np.uint64, problem: Problem, phase: Phase, h: float
) -> tuple[np.int64, np.int64, np.int64]:
    """One step of a member by code at an address; returns (result, taken, most iterations)."""
    span = Span(0.0, phase.step[0], 1, h)
    return call_for_counts(alone, problem, phase, span, bool(ZERO))


def _evaluate(problem: Problem, t: float) -> float:
    _, x, _ = stage(problem, t, Scales(0.0, 0.0, 0.0), True, True)
    return x


class MemberFunctions(NamedTuple):
    """Fields of a `LaneCrew`."""

    alone: Addresses
    forces: Addresses
    drives: Addresses
    stage: Addresses


@cache
def functions_of_members(dimension: int, adaptive: bool) -> MemberFunctions:
    """In 2 or 3 dimensions: steps of a fixed length, or `adaptive`."""
    problem, phase = Problem._numba_type(dimension), Phase._numba_type()
    now = types.void(problem, types.float64)
    one = types.void(problem, types.uint64, types.float64)
    span = typeof(Span(0.0, 0, 1, 0.0))
    alone = entry(advance_adaptively if adaptive else advance, problem, phase, span, types.boolean)
    forces = [by_address(now)(_apply), by_address(one)(_add_force), by_address(now)(_note_side)]
    drives = [by_address(now)(_prescribe)]
    stages = [by_address(types.float64(problem, types.float64))(_evaluate)]
    return MemberFunctions(
        np.array([alone], dtype=np.uint64),
        *(_addresses(each) for each in (forces, drives, stages)),
    )


def _addresses(functions: Sequence[Any]) -> Addresses:
    return np.array([each.address for each in functions], dtype=np.uint64)

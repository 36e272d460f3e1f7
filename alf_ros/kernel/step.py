"""One step of an explicit Runge-Kutta method, and many of them in one call; and what a step of an
implicit one has in common with it.

    for s = 0 … stages:                            # past the last stage: the end of the step
        ξ, w = those of the begin + h Σ_m a_sm (ξ̇, ẇ)_m       # add_up; at the end with b_m
        q, p = what the arcs ξ and their momenta w stand for  # unfold, (30)
        q onto Φ(q, t) = 0:  A δq = -Φ_qᵀ α Φ                 # project_stage; project at the end
        q̇ from p:  M q̇ + Φ_qᵀ σ = p,  Φ_q q̇ = -Φ_t            # velocities, (33)
        q̈, λ from Q:  M q̈ + Φ_qᵀ λ = Q,  Φ_q q̈ = -Φ̇_q q̇ - …   # accelerate, (26)
        ṗ = Q - Φ_qᵀ λ = M q̈, as σ = 0                        # (35)
        (ξ̇, ẇ)_s = that of q̇ and ṗ in arcs                    # fold

A = M + Φ_qᵀ α Φ_q is factorised once a stage, where it is put on Φ = 0. A stage beside a singular
position is interpolated from others along its branch (`interpolated_stages`). doc/method.md says
why; equation numbers are the paper's.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.arc_coordinates import (
    begin_momenta,
    choose_arcs,
    fold,
    fold_first,
    shift_along_path,
    unfold,
)
from alf_ros.kernel.augmented_residuals import begin_accelerations
from alf_ros.kernel.augmented_solve import accelerate, iterate, restore_reactions, velocities
from alf_ros.kernel.companion import (
    ADDED_UP,
    BEGIN_STEP,
    FIRST_STAGE,
    STAGE,
    begin_interval,
    tell,
)
from alf_ros.kernel.constraints import violation
from alf_ros.kernel.data import Method, Phase, Problem, Scales, System, Until, Work
from alf_ros.kernel.departure import rests_apart, speed_of, way_of
from alf_ros.kernel.interpolated_stages import (
    DIRECTION_ONLY,
    NEAR,
    SLOW,
    end_interpolated,
    evaluate_interpolated,
    evaluate_uninterpolated,
)
from alf_ros.kernel.kinks_over_time import stage_time
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import begin_with_det, fallen, lost, note_det, note_way, rank_lost
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, ZERO, expanded, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.vectors import (
    add_times,
    add_two_times,
    copy,
    copy_first,
    furthest,
    largest,
    put_sum,
    put_times,
    zero,
)
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.projection import project
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.slip import begin_slips
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import JAMMED, NOT_CLOSED, NOT_FINITE, OK
from alf_ros.kernel.unwrapping import count_turns, nearby, some_crossed
from alf_ros.kernel.work_ledger import ALL_FORCES, record_power

_ASTRAY = 0.75  # part of its way by which that may be more or less than its velocities say
_UNDETERMINED = 1e-7  # part of the size by which a singular position leaves q open


@inner
def evaluate_first(problem: Problem, phase: Phase, t: float) -> tuple[int, float]:
    """q̈ and -λ where the step begins, from the Φ_q and the factor that stand in `work`. Then
    `curve_path` follows.

    Returns the iterations (-1: no balance of friction), and σ as `velocities` does.
    """
    system, work = problem.system, problem.work
    copy(phase.qd, work.qd)
    work.evaluations[0] += 1
    restore_reactions(problem.forces.bearings, phase.loads)
    prescribe(system, t, work.q, work.qd, work.qdd)
    most, sigma = accelerate(problem, t, True)  # (26)
    if most < 0:
        return most, sigma
    record_power(problem, phase, t, np.uint64(0), 1.0, ALL_FORCES)
    copy(work.qdd, work.pull)
    return most, sigma


@inner
def curve_path(problem: Problem) -> None:
    """The curvature of the path where the step begins, behind `evaluate_first`."""
    unit, system, work = problem.unit, problem.system, problem.work
    if system.prescribed.program.size > 0:  # else blocks that are not movable stand
        copy(work.qdd, work.bend)
    for i in range(work.p.size):
        work.bend[i] = 0.0
    zero(work.p)
    begin_accelerations(unit, system, work, work.p)
    until = Until(np.int64(problem.method.iterations), 1e-3, 1.0)
    iterate(unit, system, work, work.p, work.bend, until)  # (26) with Q = 0


@inner
def end_step(
    problem: Problem,
    phase: Phase,
    end: float,
    h: float,
    near: bool,
    suspect: bool,
    scales: Scales,
) -> tuple[int, int]:
    """The end of a step of h (s), q and p' in `work`, onto Φ = 0, with Φ_q and factor, and q̇;
    returns (result, iterations).

    Where the last stage was beside a singular position (`near`) the end is judged like a stage:
    closer to the position than its error it would come to lie on another branch. In the position
    itself the solves do not depend on the row that tells the branch, so the rank of Φ_q is counted
    if any stage was beside a position (`suspect`).
    """
    unit, system, work = problem.unit, problem.system, problem.work
    work.aside[0], work.aside[1] = 0, 0
    copy(work.q, work.base)
    if not near:
        result = project(unit, system, work, False)
        if result != OK:
            return result, 0
        note_det(unit, work)
        near = (suspect or fallen(work)) and lost(unit, system, work)
        if not near:
            most, _sigma = velocities(problem, True)  # (33)
            return _finite(work, OK), most
        copy(work.base, work.q)
    copy(work.qd, work.along)
    copy(work.q, work.target)
    most, x, clear = stage(problem, end, scales, True, True)
    if most == 0 or (most < 0 and clear):
        return JAMMED if most < 0 else NOT_CLOSED, 1
    if clear and not (x == np.inf and lost(unit, system, work)):
        copy(work.base, work.q)
        result = project(unit, system, work, True)
        if result == OK:
            work.aside[1] = lost(unit, system, work)  # as a restored state finds it
            most, _sigma = velocities(problem, True)  # (33)
    else:
        moved = furthest(work.q, work.base, work.p.size)
        result, most = end_interpolated(problem, phase, end, moved, scales)
    note_det(unit, work)
    if result == OK and _is_astray(system, work, phase, h):
        result = NOT_CLOSED
    return _finite(work, result), most


@inner
def _is_astray(system: System, work: Work, phase: Phase, h: float) -> bool:
    """Whether the end of a step of h (s) beside a singular position is not where the velocities at
    both ends lead: where rounding decides about rows they may hold what they should let go."""
    off, way = 0.0, 0.0
    for a in range(work.p.size):
        gone, begun, ended = work.q[a] - phase.q[a], h * phase.qd[a], h * work.qd[a]
        off = max(off, gone - max(begun, ended), min(begun, ended) - gone)
        way = max(way, abs(gone), abs(begun), abs(ended))
    return off > _ASTRAY * way + _UNDETERMINED * system.size


@inner
def _finite(work: Work, result: int) -> int:
    """The result; NOT_FINITE if q or q̇ are no numbers."""
    check = 0.0
    for i in range(work.p.size):
        check += work.q[i] + work.qd[i]
    return result if result != OK or np.isfinite(check) else NOT_FINITE


@inner
def add_up(method: Method, work: Work, s: np.uint64, h: float) -> None:
    """ξ and w of stage s into q and p of `work`, from the stages before; with s past the last
    stage, of the end of the step. Into q̇ goes ξ̇ as the sum of ξ̈.

    Without arcs this q̇ gives all of p. With arcs it is a first guess, without which solves beside
    a singular position that many rows share would take too long.
    """
    n, stages, chart, total = work.p.size, method.b.size, work.chart, work.total
    arcs = anywhere(chart.arcs[0] > 0)
    used = THREE * n if arcs else TWO * n
    # the first term alone, then two at a time, each beside the last one that waits
    begun, waits, before = False, 0.0, section(work.k, ZERO, used)
    for m in range(s):
        part = method.a[s * stages + m] if s < stages else method.b[m]
        if part != 0.0:
            rates = section(work.k, m * THREE * n, used)
            if not begun:
                put_times(h * part, rates, total, used)
            elif waits == 0.0:
                waits, before = part, rates
            else:
                add_two_times(h * waits, before, h * part, rates, total, used)
                waits = 0.0
            begun = True
    if waits != 0.0:
        add_times(h * waits, before, total, used)
    if not begun:
        zero(total)
    copy_first(total, work.q, n)
    put_sum(chart.rate, section(total, n, n), work.qd, n)
    if arcs:
        put_sum(chart.momentum, section(total, TWO * n, n), chart.w, n)
        copy_first(chart.w, work.p, n)


@inner
def still_within(system: System, work: Work, phase: Phase, scales: Scales) -> bool:
    """Whether a stage, as added up, is too close to the singular position where its step begins:
    rounding may hide a row that has no direction there, or take another one for such a row."""
    apart = rests_apart(system, phase.q)
    way = way_of(system, apart, work.target, phase.q, work.p.size)
    own = scales_of(system, work, phase, True) if apart else scales
    return way < system.close * own.radius


@inner
def stands(system: System, work: Work, phase: Phase, scales: Scales) -> bool:
    """Whether what may rest in a singular position is too slow to have a direction."""
    apart = rests_apart(system, phase.q)
    own = scales_of(system, work, phase, True) if apart else scales
    return not speed_of(system, apart, phase.qd, work.p.size) > SLOW * own.falling


@expanded
def step(
    problem: Problem,
    phase: Phase,
    interval: tuple[float, float, float, float],
    sigma: float,
    begun: bool,
) -> tuple[int, int]:
    """One step from q, q̇ of `phase`, whose Φ_q and factor stand in `work`.

    `interval`: begin, end and length, s, and the time of the drives where the step ends.
    `begun`: stage 0 stands in `work`, of a step that was too long; Φ_q and factor need not then.
    `sigma`: 0 in a singular position that solves may not show, else infinite. Leaves the new q, q̇
    in `work`, with Φ_q and factor. Returns (result, most iterations).
    """
    t, end, h, there = interval
    unit, system = problem.unit, problem.system
    method, work = problem.method, problem.work
    stages = method.b.size
    most, first = 1, ONE
    if not begun:
        first -= ONE
        most, felt = evaluate_first(problem, phase, t)
        if most < 0:
            return JAMMED, 1
        tell(problem, phase, FIRST_STAGE, 0, t, felt)
        curve_path(problem)
        sigma = min(sigma, felt)
    scales = scales_of(system, work, phase, False)
    begin_momenta(unit, system, work, phase, choose_arcs(unit, system, work, phase, h))
    if begun:
        fold_first(unit, system, work, phase)
    begin_interval(problem, t, end, h)
    tell(problem, phase, BEGIN_STEP, int(begun), t, sigma)
    nearest = np.inf
    within = sigma == 0.0 and stands(system, work, phase, scales)
    x = np.inf  # where the last stage was about to be singular this one is likely to be
    for s in range(first, stages + ONE):
        add_up(method, work, s, h)
        ts = stage_time(t, end, h, method.c[s]) if s < stages else there
        prescribe(system, ts, work.q, work.qd, work.qdd)
        unfold(unit, system, work, phase)  # (30)
        if s == stages:
            break
        if s == 0:
            count, x = 1, sigma / system.ordinary
            clear = x > scales.close
        else:
            shift_along_path(unit, system.arms, work, h * h * method.lag[s])
            count, x, clear = stage(problem, ts, scales, x < np.inf, True)  # (33), (26)
            if within and still_within(system, work, phase, scales):
                x, clear = min(x, scales.close), False
            record_power(problem, phase, ts, s, 1.0, ALL_FORCES)
        nearest = min(nearest, x)
        if not clear and count != 0:
            moved = furthest(work.q, work.target, work.p.size) if s > 0 else 0.0
            add_up(method, work, s, h)
            prescribe(system, ts, work.q, work.qd, work.qdd)
            unfold(unit, system, work, phase)
            copy(work.q, work.base)
            copy(work.qd, work.along)
            count = evaluate_interpolated(problem, phase, ts, s, moved, scales)
            if count < 0 and x > DIRECTION_ONLY:
                count = evaluate_uninterpolated(problem, phase, ts, s, scales)
        if count <= 0:
            return JAMMED if count < 0 else NOT_CLOSED, most
        most = max(most, count)
        if s == 0:
            copy(work.qdd, work.chart.first)
        fold(unit, system, work, work.qd, work.qdd, s)  # (35)
        tell(problem, phase, STAGE, s, ts, x)
    tell(problem, phase, ADDED_UP, stages, end, x)
    work.nearest[0] = nearest
    result, count = end_step(problem, phase, there, h, x < np.inf, nearest < np.inf, scales)
    if nearest < NEAR:
        work.crossing[2] = max(work.crossing[2], h * largest(phase.qd, work.p.size))
    return result, max(most, count)


@inner
def store_angles(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """The angles of the phase, and the sums that it keeps constant, into `work`."""
    violation(unit, system.angles, phase.q, work.angle_before)
    nearby(work.angle_before, phase.turns, work.near)
    begin_slips(unit, system, work, phase)


@inner
def linearise_first(unit: Unit, system: System, work: Work, phase: Phase) -> bool:
    """Φ_q, factor and angles of the phase into `work`; False if A is not positive definite."""
    store_angles(unit, system, work, phase)
    copy(phase.q, work.q)
    factored = linearise(unit, system, work, work.q)
    note_det(unit, work)
    begin_with_det(work)
    if np.isnan(phase.within[0]):
        phase.within[0] = 1.0 if rank_lost(unit, system, work) else 0.0
    return factored


@inner
def save_grid_point(problem: Problem, phase: Phase) -> None:
    """Save the phase, a point of the grid, for `restore_grid_point`."""
    forces, work = problem.forces, problem.work
    copy(phase.q, work.good_q)
    copy(phase.qd, work.good_qd)
    copy(phase.turns, work.good_turns)
    copy(phase.tangents, work.good_tangents)
    copy(phase.works, forces.ledger.good)
    copy(phase.loads, forces.bearings.good)
    copy(phase.within, work.good_within)


@inner
def restore_grid_point(problem: Problem, phase: Phase) -> None:
    """The phase that was saved last."""
    forces, work = problem.forces, problem.work
    copy(work.good_q, phase.q)
    copy(work.good_qd, phase.qd)
    copy(work.good_turns, phase.turns)
    copy_first(work.good_tangents, phase.tangents, work.good_tangents.size)
    copy(forces.ledger.good, phase.works)
    copy(forces.bearings.good, phase.loads)
    copy(work.good_within, phase.within)


@inner
def note_leap(system: System, work: Work, phase: Phase, h: float) -> None:
    """Keep in mind a step of h (s), about to be accepted, that may have leapt over a singular
    position."""
    if system.soft.weight.size == 0:  # else det A depends on h
        note_way(work, h * largest(phase.qd, work.p.size), True)


@inner
def accept(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """Take the end of a step that succeeded as the new phase."""
    if some_crossed(unit, system.angles, work.q, work.angle_before):  # else `near` stays
        violation(unit, system.angles, phase.q, work.angle_before)
        violation(unit, system.angles, work.q, work.angle)
        count_turns(work.angle_before, work.angle, phase.turns)
        copy(work.angle, work.angle_before)
        nearby(work.angle, phase.turns, work.near)
    begin_with_det(work)
    copy(work.q, phase.q)
    copy(work.qd, phase.qd)
    begin_slips(unit, system, work, phase)
    phase.within[0] = float(work.aside[1])


@inner
def least_sigma(phase: Phase) -> float:
    """0 in a singular position, where solves exactly in it do not show σ; else infinite."""
    return 0.0 if phase.within[0] > 0.0 else np.inf

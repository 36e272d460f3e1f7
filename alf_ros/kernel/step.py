"""One step of an explicit Runge-Kutta method, and many of them in one call; and what a step of an
implicit one has in common with it.

    for s = 0 … stages:                            # past the last stage: the end of the step
        ξ, w = those of the begin + h Σ_m a_sm (ξ̇, ẇ)_m       # add_up; at the end with b_m
        q, p = what the arcs ξ and their momenta w stand for  # unfold
        q onto Φ(q, t) = 0:  A δq = -Φ_qᵀ α Φ                 # place; project at the end
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
from alf_ros.kernel.arc_coordinates import fold, fold_again, lay, lead, unfold
from alf_ros.kernel.augmented_residuals import begin_accelerations
from alf_ros.kernel.augmented_solve import accelerate, augmented, begin_balance, velocities
from alf_ros.kernel.constraints import violation
from alf_ros.kernel.data import Forces, Method, Phase, System, Watch, Work
from alf_ros.kernel.interpolated_stages import BLIND, end_aside, evaluate_aside, evaluate_there
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import begin_with_det, fallen, lost, note_det, rank_lost
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, compiled, expanded, inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.projection import project
from alf_ros.kernel.singularity_monitor import note
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import JAMMED, NOT_CLOSED, NOT_FINITE, NOT_POSITIVE, OK
from alf_ros.kernel.step_error import judge
from alf_ros.kernel.unwrapping import count_turns, nearby
from alf_ros.kernel.work_ledger import ALL, tally


@inner
def evaluate_first(
    unit: Unit, system: System, forces: Forces, work: Work, phase: Phase, t: float, iterations: int
) -> tuple[int, float]:
    """q̈ where the step begins, from the Φ_q and the factor that stand in `work`, and the
    curvature of the path; the iterations (-1: friction jams), and σ as `velocities` says it."""
    copy(phase.qd, work.qd)
    work.evaluations[0] += 1
    begin_balance(forces.bearings, phase.loads)
    prescribe(system, t, work.q, work.qd, work.qdd)
    most, sigma = accelerate(unit, system, forces, work, t, iterations, True)  # (26)
    if most < 0:
        return most, sigma
    tally(forces.ledger.tally, system, forces, work, phase, t, np.uint64(0), 1.0, ALL)
    copy(work.qdd, work.pull)
    copy(work.qdd, work.bend)  # of what is prescribed
    for i in range(work.p.size):
        work.bend[i] = 0.0
    zero(work.p)
    begin_accelerations(unit, system, work, work.p)
    augmented(unit, system, work, work.p, work.bend, iterations, 1e-3, 1.0, True)
    return most, sigma


@inner
def nearness(system: System, work: Work, phase: Phase) -> tuple[float, float, float]:
    """The radius of the path (m), the distance x to a singular position below which rounding would
    be felt in this step, and the speed (m/s) that the forces give along the size."""
    n = work.p.size
    fastest, hardest = largest(phase.qd, n), largest(work.pull, n)
    bend = largest(work.bend, n)
    radius, close = system.size, system.close
    if fastest * fastest < radius * bend:
        radius = fastest * fastest / bend
    # rounding is felt as v² / x³: what is slow may be closer
    if fastest * fastest < radius * hardest:
        close *= (fastest * fastest / (radius * hardest)) ** (1.0 / 3.0)
    return radius, close, np.sqrt(hardest * system.size)


@inner
def end_step(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    end: float,
    near: bool,
    suspect: bool,
    radius: float,
    close: float,
    falling: float,
    iterations: int,
) -> tuple[int, int]:
    """The end of a step, q and p' in `work`, onto Φ = 0, with Φ_q and factor, and q̇; returns
    (result, iterations).

    Where the last stage was beside a singular position (`near`) the end is judged like a stage:
    closer to the position than its error it would come to lie on another branch. In the position
    itself nothing is felt of the row that tells the branch, so its rank is counted if any stage
    was beside one (`suspect`). `radius`, `close`, `falling`: as `nearness` returns.
    """
    work.aside[0], work.aside[1] = 0, 0
    copy(work.q, work.base)
    copy(work.qd, work.along)
    if not near:
        result = project(unit, system, work, False)
        if result != OK:
            return result, 0
        note_det(unit, work)
        near = (suspect or fallen(work)) and lost(unit, system, work)
        if not near:
            most, _sigma = velocities(unit, system, work, iterations, True)  # (33)
            return _finite(work, OK), most
        copy(work.base, work.q)
    copy(work.q, work.target)
    most, x, clear = stage(unit, system, forces, work, end, radius, close, True, iterations, True)
    if most <= 0:
        return JAMMED if most < 0 else NOT_CLOSED, 1
    if clear and not (x == np.inf and lost(unit, system, work)):
        copy(work.base, work.q)
        result = project(unit, system, work, True)
        if result == OK:
            most, _sigma = velocities(unit, system, work, iterations, True)  # (33)
    else:
        moved = furthest(work.q, work.base, work.p.size)
        result, most = end_aside(
            unit, system, forces, work, phase, end, moved, radius, close, falling, iterations
        )
    note_det(unit, work)
    return _finite(work, result), most


@inner
def _finite(work: Work, result: int) -> int:
    """The result, but for q or q̇ that are no numbers."""
    check = 0.0
    for i in range(work.p.size):
        check += work.q[i] + work.qd[i]
    return result if result != OK or np.isfinite(check) else NOT_FINITE


@inner
def add_up(method: Method, work: Work, s: np.uint64, h: float) -> None:
    """ξ and w of stage s, or past the last of the end of the step, from the stages before, into q
    and p of `work`; in q̇ ξ̇ as ξ̈ makes it. Without arcs that is all of p; else it is a guess,
    without which solves beside a singular position that many rows share would take too long."""
    n, stages, chart, total = work.p.size, method.b.size, work.chart, work.total
    arcs = chart.arcs[0] > 0
    used = THREE * n if arcs else TWO * n
    zero(total)
    for m in range(s):
        weight = h * (method.a[s * stages + m] if s < stages else method.b[m])
        if weight != 0.0:
            first = m * THREE * n
            for i in range(used):
                total[i] += weight * work.k[first + i]
    for i in range(n):
        work.q[i] = total[i]
        work.qd[i] = chart.rate[i] + total[n + i]
    if arcs:
        for i in range(n):
            chart.w[i] = work.p[i] = chart.momentum[i] + total[TWO * n + i]


@expanded
def step(
    unit: Unit,
    system: System,
    forces: Forces,
    method: Method,
    work: Work,
    phase: Phase,
    t: float,
    end: float,
    h: float,
    sigma: float,
    begun: bool,
) -> tuple[int, int]:
    """One step of h (s) from q, q̇ of `phase`, whose Φ_q and factor stand in `work`, at t to `end`.

    `begun`: stage 0 stands in `work`, of a step that was too long; Φ_q and factor need not then.
    `sigma`: 0 in a singular position that may not be felt, else infinite. Leaves the
    new q, q̇ in `work`, with Φ_q and factor. Returns (result, most iterations).
    """
    arms, chart = system.arms, work.chart
    stages, iterations = method.b.size, np.int64(method.iterations)
    most, first = 1, ONE
    if not begun:
        first -= ONE
        most, felt = evaluate_first(unit, system, forces, work, phase, t, iterations)
        if most < 0:
            return JAMMED, 1
        sigma = min(sigma, felt)
    radius, close, falling = nearness(system, work, phase)
    lay(unit, system, chart, work, phase, h)
    if begun:
        fold_again(unit, system, chart, work, phase)
    suspect = False
    x = np.inf  # where the last stage was about to be singular this one is likely to be
    for s in range(first, stages + ONE):
        add_up(method, work, s, h)
        ts = t + method.c[s] * h if s < stages else end
        prescribe(system, ts, work.q, work.qd, work.qdd)
        unfold(unit, system, chart, work, phase)
        if s == stages:
            break
        copy(work.q, work.base)
        if s == 0:
            count, x = 1, sigma / system.ordinary
            clear = x > close
        else:
            copy(work.q, work.target)
            # how far the stage is behind the path, in h² of its curvature
            lag = 0.5 * method.c[s] * method.c[s]
            for m in range(s):
                lag -= method.a[s * stages + m] * method.c[m]
            lead(unit, arms, chart, work, h * h * lag)
            count, x, clear = stage(
                unit, system, forces, work, ts, radius, close, x < np.inf, iterations, True
            )
            tally(forces.ledger.tally, system, forces, work, phase, ts, s, 1.0, ALL)
        suspect |= x < np.inf
        if not clear and count > 0:
            moved = furthest(work.q, work.base, work.p.size)
            add_up(method, work, s, h)
            prescribe(system, ts, work.q, work.qd, work.qdd)
            unfold(unit, system, chart, work, phase)
            copy(work.qd, work.along)
            count = evaluate_aside(
                unit,
                system,
                forces,
                work,
                phase,
                ts,
                s,
                moved,
                radius,
                close,
                falling,
                iterations,
            )
            if count < 0 and x > BLIND:
                count = evaluate_there(
                    unit, system, forces, work, phase, ts, s, radius, close, iterations
                )
        if count <= 0:
            return JAMMED if count < 0 else NOT_CLOSED, most
        most = max(most, count)
        if s == 0:
            copy(work.qdd, chart.first)
        fold(unit, system, chart, work, work.qd, work.qdd, s)  # (35)
    result, count = end_step(
        unit,
        system,
        forces,
        work,
        phase,
        end,
        x < np.inf,
        suspect,
        radius,
        close,
        falling,
        iterations,
    )
    return result, max(most, count)


@inner
def mark(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """The angles of the phase into `work`."""
    violation(unit, system.angles, phase.q, work.angle_before)
    nearby(work.angle_before, phase.turns, work.near)


@inner
def begin(unit: Unit, system: System, work: Work, phase: Phase) -> bool:
    """Φ_q, factor and angles of the phase into `work`; False if there is no factor."""
    mark(unit, system, work, phase)
    copy(phase.q, work.q)
    factored = linearise(unit, system, work, work.q)
    note_det(unit, work)
    begin_with_det(work)
    if np.isnan(phase.within[0]):
        phase.within[0] = 1.0 if rank_lost(unit, system, work) else 0.0
    return factored


@inner
def keep(forces: Forces, work: Work, phase: Phase) -> None:
    """The phase is a point of the grid, to come back to."""
    copy(phase.q, work.good_q)
    copy(phase.qd, work.good_qd)
    copy(phase.turns, work.good_turns)
    copy(phase.works, forces.ledger.good)
    copy(phase.loads, forces.bearings.good)
    copy(phase.within, work.good_within)


@inner
def fall_back(forces: Forces, work: Work, phase: Phase) -> None:
    """Back to what was kept."""
    copy(work.good_q, phase.q)
    copy(work.good_qd, phase.qd)
    copy(work.good_turns, phase.turns)
    copy(forces.ledger.good, phase.works)
    copy(forces.bearings.good, phase.loads)
    copy(work.good_within, phase.within)


@inner
def accept(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """Take the end of a step that went well as the new phase."""
    violation(unit, system.angles, work.q, work.angle)
    count_turns(work.angle_before, work.angle, phase.turns)
    copy(work.angle, work.angle_before)
    begin_with_det(work)
    nearby(work.angle, phase.turns, work.near)
    copy(work.q, phase.q)
    copy(work.qd, phase.qd)
    phase.within[0] = float(work.aside[1])


@inner
def least_sigma(phase: Phase) -> float:
    """0 in a singular position, which exactly there is not felt; else infinite."""
    return 0.0 if phase.within[0] > 0.0 else np.inf


@compiled
def advance(
    unit: Unit,
    system: System,
    forces: Forces,
    method: Method,
    work: Work,
    phase: Phase,
    watch: Watch | None,
    t0: float,
    first: int,
    steps: int,
    h: float,
    within: bool,
) -> tuple[int, int, int]:
    """Take `steps` steps of h from step number `first`; returns (result, taken, most iterations).

    `phase` is the state, in and out; on failure it holds the last good step. It ends earlier after
    a step in which, for all that `watch` tells, a singular position may have been passed. `within`
    says that `phase` is a singular position, which exactly there is not felt: nothing asks for the
    direction that a row has lost.
    """
    most = 0
    if not begin(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    sigma = 0.0 if within else least_sigma(phase)
    for taken in range(steps):
        t, end = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        result, count = step(unit, system, forces, method, work, phase, t, end, h, sigma, False)
        most = max(most, count)
        if result == OK:
            result = judge(unit, system, method, work, h)
        if result != OK:
            return result, taken, most
        tally(forces.ledger.tally, system, forces, work, phase, t, method.b.size, h, ALL)
        accept(unit, system, work, phase)
        copy(forces.bearings.force, phase.loads)
        sigma = least_sigma(phase)
        if watch is not None:  # known when it is compiled: who does not watch does without
            if note(unit, system, work, watch, phase, end):
                return OK, taken + 1, most  # to be looked at
    return OK, steps, most

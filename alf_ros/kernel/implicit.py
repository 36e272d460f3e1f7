"""Steps of a diagonally implicit Runge-Kutta method, for effects so stiff that they would limit
the step of an explicit one.

A stage solves for k = q̈ at q = q_b + hγ v, v = v_b + hγ k: M k + Φ_qᵀ λ = Q(q, v). Newton's
method solves M̂ k' + Φ_qᵀ λ = Q + (M̂ - M) k with M̂ = M + hγ C + (hγ)² K (`effect_jacobians`):
the stage (26) of an explicit method with M̂ in the place of M. Stages are therefore projected onto
Φ = 0 and continued through singular positions in the same way, on the same pattern. The first
stage is explicit, and the last one is the end of the step.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.adaptive import BEYOND, ENDED, REFUSED, collapsed, forget_end
from alf_ros.kernel.companion import (
    BEGIN_CALL,
    END_STEP,
    begin_interval,
    is_accompanied,
    part_to_kink,
    tell,
)
from alf_ros.kernel.crossed_kinks import across_kinks, next_aim, passed, shorter
from alf_ros.kernel.data import (
    EPS,
    Method,
    Phase,
    Problem,
    Scales,
    Span,
    System,
    Work,
)
from alf_ros.kernel.effect_jacobians import add_soft_times, weigh
from alf_ros.kernel.fixed_steps import PIECES
from alf_ros.kernel.grazed_kinks import UNFOUND, unresolved_kink
from alf_ros.kernel.interpolated_stages import (
    DIRECTION_ONLY,
    evaluate_interpolated,
    evaluate_uninterpolated,
    linearise_aside,
)
from alf_ros.kernel.kinks_over_time import (
    end_of_drives,
    just_behind,
    stage_time,
    until_kink,
)
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.lost_rank import begin_with_det, note_det, rank_lost
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, ZERO, compiled, expanded, inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.singularity_monitor import is_watched, may_have_passed
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import (
    FORCE_JUMPS,
    JAMMED,
    NOT_CLOSED,
    NOT_POSITIVE,
    NOT_SETTLED,
    OK,
    STOPPED,
    TOO_MANY,
)
from alf_ros.kernel.step import (
    accept,
    curve_path,
    end_step,
    evaluate_first,
    least_sigma,
    note_leap,
    restore_grid_point,
    save_grid_point,
    stands,
    still_within,
    store_angles,
)
from alf_ros.kernel.step_error import free_part, judge
from alf_ros.kernel.step_length import MOST, embedded, relative
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.trail import leave_trail
from alf_ros.kernel.work_ledger import ALL_FORCES, record_power

_PASSES = 30  # of Newton's method, at most
_CONVERGED = 1e-3  # part of the tolerance to which Newton's method is finished
_SHARE = 0.02  # of the tolerance for one step of an adaptive method: errors add up along a motion
_ROUNDING = 1e-9  # relative error of a step that may be rounding, beside a singular position
_FLAT = 1e-12  # and elsewhere
_FURTHEST = 0.3  # part of the size that a first guess may be from the start of the step
_SHORTEST = 1e-9  # part of the step of the grid


@expanded
def _solve_stage(
    problem: Problem,
    phase: Phase,
    at: tuple[float, float],
    s: np.uint64,
    near: bool,
    within: bool,
    rate: float,
    scales: Scales,
) -> tuple[int, int, float, float]:
    """Solve stage s by Newton's method, from q_b and v_b in `work` and a guess of k in `soft.k`.

    at: when, and hγ, s; near: whether the last stage was near a singular position; within: whether
    the step begins in one; rate: at which Newton's method converged at the last stage. Stores v
    and k in `work.k`. Returns (result, most iterations, whether the stage is near a singular
    position, rate).
    """
    t, gamma = at
    unit, system = problem.unit, problem.system
    method, work = problem.method, problem.work
    n, k, rates = work.p.size, system.soft.k, work.k
    rate_at = THREE * s * n
    change_at = rate_at + n  # where k goes in the end, and until then what a pass changes of it
    speed, most, before, part = max(largest(phase.qd, n), scales.falling), 1, np.inf, 1.0
    for i in range(n):
        rates[change_at + i] = 0.0
    for _ in range(_PASSES):
        for i in range(n):
            work.qd[i] = work.before_qd[i] + gamma * k[i]
            work.q[i] = work.before_q[i] + gamma * work.qd[i]
            rates[rate_at + i] = work.qd[i]
        prescribe(system, t, work.q, work.qd, work.qdd)
        weigh(unit, system, problem.forces, work, t, gamma)
        zero(work.p)
        add_mass_times(unit, system.mass, 1.0, work.qd, work.p)
        add_soft_times(unit, system.soft, 1.0, work.qd, work.p)  # (30) with M̂
        copy(work.q, work.base)
        copy(work.q, work.target)  # a stage of order 2 is not behind the path
        count, x, clear = stage(problem, t, scales, near, True)  # (33), (26) with M̂ for M
        if within and still_within(system, work, phase, scales):
            x, clear = min(x, scales.close), False
        near = x < np.inf
        if not clear and count != 0:
            moved = furthest(work.q, work.base, n)
            for i in range(n):
                work.along[i] = rates[rate_at + i]
            count = evaluate_interpolated(problem, phase, t, s, moved, scales)
            if count < 0 and x > DIRECTION_ONLY:
                count = evaluate_uninterpolated(problem, phase, t, s, scales)
        if count <= 0:
            return JAMMED if count < 0 else NOT_CLOSED, most, near, rate
        most = max(most, count)
        change, turned = 0.0, 0.0
        for i in range(n):
            delta = work.qdd[i] - k[i]
            turned += delta * rates[change_at + i]
            rates[change_at + i] = delta
            change = max(change, abs(delta))
        if not np.isfinite(turned):
            break
        if before < np.inf:
            rate = change / before
            # a pass that goes to and fro, as across a kink, is shortened
            part = max(0.5 * part, 0.03) if turned < 0.0 and rate > 0.3 else min(1.0, 2.0 * part)
        for i in range(n):
            k[i] += part * rates[change_at + i]
        left = gamma * change * (rate / (1.0 - rate) if rate < 0.5 else 1.0)
        fine = max(_CONVERGED * method.tolerance * speed, 8.0 * EPS * system.size / gamma)
        if left <= fine:
            for i in range(n):
                change_of_v = gamma * part * rates[change_at + i]
                rates[change_at + i] = k[i]
                rates[rate_at + i] = work.before_qd[i] + gamma * k[i]
                if x < DIRECTION_ONLY:
                    rates[rate_at + i] = work.qd[i]
                work.qd[i] = rates[rate_at + i]  # of which the step is made, for the power
                work.q[i] += gamma * change_of_v
            if clear:  # else the places of the interpolation were recorded
                record_power(problem, phase, t, s, 1.0, ALL_FORCES)
            return OK, most, near, rate
        before = change
    return NOT_SETTLED, most, near, rate


@expanded
def _step(
    problem: Problem, phase: Phase, interval: tuple[float, float, float, float], begins: bool
) -> tuple[int, int]:
    """One step from `phase`; `begins`: `within` of `advance`; the rest as of `step.step`."""
    t, end, h, there = interval
    unit, system = problem.unit, problem.system
    method, work = problem.method, problem.work
    n = work.p.size
    q, qd, rates = phase.q, phase.qd, work.k
    stages = method.b.size
    zero(system.soft.weight)
    copy(q, work.q)
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE, 1
    note_det(unit, work)
    begin_with_det(work)
    if phase.within[0] != 0.0:  # with M̂ the end of a step cannot tell
        phase.within[0] = 1.0 if rank_lost(unit, system, work) else 0.0
    sigma = 0.0 if begins else least_sigma(phase)
    most, felt = evaluate_first(problem, phase, t)
    if most < 0:
        return JAMMED, 1
    curve_path(problem)
    sigma = min(sigma, felt)
    x, result = sigma / system.ordinary, OK
    scales = scales_of(system, work, phase, False)
    if x <= scales.close:
        copy(q, work.base)
        copy(qd, work.qd)
        copy(qd, work.along)
        zero(work.p)
        add_mass_times(unit, system.mass, 1.0, work.qd, work.p)  # (30)
        count = evaluate_interpolated(problem, phase, t, np.uint64(0), 0.0, scales)
        if count <= 0:
            return JAMMED if count < 0 else NOT_CLOSED, most
    for i in range(n):
        rates[i] = qd[i]
        rates[n + i] = work.qdd[i]
    within = sigma == 0.0 and stands(system, work, phase, scales)
    near, rate, gamma = x < np.inf, 1.0, 0.0
    suspect = near
    for s in range(ONE, stages):
        gamma = h * method.a[s * stages + s]
        for i in range(n):
            work.before_q[i] = 0.0
            work.before_qd[i] = 0.0
            system.soft.k[i] = 0.0
        for m in range(s):
            weight, guess = method.a[s * stages + m], method.guess[s * stages + m]
            at = THREE * m * n
            for i in range(n):
                work.before_q[i] += weight * rates[at + i]
                work.before_qd[i] += weight * rates[at + n + i]
                system.soft.k[i] += guess * rates[at + n + i]
        furthest = 0.0
        for i in range(n):
            work.before_q[i] = q[i] + h * work.before_q[i]
            work.before_qd[i] = qd[i] + h * work.before_qd[i]
            v = work.before_qd[i] + gamma * system.soft.k[i]
            furthest = max(furthest, abs(work.before_q[i] + gamma * v - q[i]))
        if not furthest < _FURTHEST * system.size:
            for i in range(n):  # a stiff stage may be extrapolated wrongly: guess a standstill
                v = (q[i] - work.before_q[i]) / gamma
                system.soft.k[i] = (v - work.before_qd[i]) / gamma
        ts = stage_time(t, end, h, method.c[s])
        result, count, near, rate = _solve_stage(
            problem, phase, (ts, gamma), s, near, within, rate, scales
        )
        most = max(most, count)
        suspect |= near
        if result != OK:
            return result, most
    last = THREE * (stages - ONE) * n
    for i in range(n):
        work.qd[i] = work.before_qd[i] + gamma * rates[last + n + i]
        work.q[i] = work.before_q[i] + gamma * rates[last + i]
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.qd, work.p)
    add_soft_times(unit, system.soft, 1.0, work.qd, work.p)  # (30) with M̂
    prescribe(system, there, work.q, work.qd, work.qdd)
    work.nearest[0] = 0.0 if suspect else np.inf
    if suspect:
        work.crossing[2] = max(work.crossing[2], h * largest(qd, n))
    result, count = end_step(problem, phase, there, h, near, suspect, scales)
    return result, max(most, count)


@inner
def _free_error(
    unit: Unit, system: System, method: Method, work: Work, rate: np.uint64, h: float
) -> float:
    """The embedded error of the variable with rate number `rate`, in the metric of M̂."""
    embedded(method, work, rate, 0, h)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.sum, work.p)
    add_soft_times(unit, system.soft, 1.0, work.sum, work.p)
    return free_part(unit, system, work)


@inner
def _error(
    unit: Unit, system: System, method: Method, work: Work, phase: Phase, h: float
) -> float:
    """Relative error of the step of h that ended in `work`, in parts of what it may be; 0 if the
    method has no embedded one."""
    if method.embedded.size == 0:
        return 0.0
    n = work.p.size
    pull = largest(work.pull, n)
    speed = max(largest(phase.qd, n), largest(work.qd, n), np.sqrt(system.size * pull))
    if work.aside[0]:
        linearise_aside(unit, system, work)
    displacement = _free_error(unit, system, method, work, ZERO, h)
    velocity = _free_error(unit, system, method, work, ONE, h)
    if work.aside[0]:
        linearise(unit, system, work, work.q)
    return relative(system, displacement, velocity, speed) / (_SHARE * method.tolerance)


@compiled
def advance_implicitly(
    problem: Problem, phase: Phase, span: Span, within: bool
) -> tuple[int, int, int]:
    """Like `advance`; a step whose stages do not converge is taken in parts, and with an embedded
    error each in as many as the tolerance of the method takes."""
    unit, system = problem.unit, problem.system
    method, work = problem.method, problem.work
    t0, first, steps, h = span
    pace, adaptive, kinks = phase.pace, method.embedded.size > 0, problem.forces.kinks
    good_pace = pace[0]
    save_grid_point(problem, phase)
    tell(problem, phase, BEGIN_CALL, 0, t0, 0.0)
    most, here = 0, within
    store_angles(unit, system, work, phase)
    for taken in range(steps):
        forget_end(problem.forces.bearings)
        t, end = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        done, goal, result, tried, unsettled, refused = 0.0, 0.0, OK, 0, 0, 0
        cuts = 0  # pieces of a fixed step
        since, crossings = 0.0, 0  # s since a kink was crossed; pieces on the way to crossings
        tries, before, longer = 0, np.inf, h  # from here; error and length of the last
        trial = False  # whether the step only tells if the balance of friction ends
        length = pace[0] if adaptive else h
        while done < h:
            tried += 1
            if tried > MOST:
                result = TOO_MANY if 4 * unsettled < MOST else NOT_SETTLED
                break
            aim = goal if goal > done else h  # where a kink is met and left in a step, before h
            left, begin, latest = aim - done, t + done, np.inf
            if kinks.instants.size > 0:
                ahead, earliest, latest = until_kink(kinks.instants, begin, left, h)
                begin = max(begin, earliest)
                if ahead < left:
                    left, aim = ahead, done + ahead
            parts = max(1.0, np.ceil(0.999999 * left / length))  # no crumb at the grid point
            dt = left / parts
            whole = parts == 1.0 and aim == h
            to = min(end if whole else begin + dt, latest)
            there = end_of_drives(to, end, whole)
            if not adaptive:
                begin = just_behind(begin, to)
            result, count = _step(problem, phase, (begin, to, dt, there), here)
            most = max(most, count)
            if told_to_stop(work):
                result = STOPPED
                break
            if trial:
                result = collapsed(problem.forces.bearings, result, begin)
                break
            error, factor = np.inf, 0.5
            if result == OK:
                error = _error(unit, system, method, work, phase, dt)
            if np.isfinite(error):
                factor = min(5.0, max(0.2, 0.8 * error**-0.25)) if error > 0.0 else 5.0
            good = error <= 1.0
            if not good and tries > 0 and error > before * (dt / longer) ** 1.5:
                # the error of the method falls as h⁴, rounding as h: shorter is no better
                likely = _ROUNDING if work.nearest[0] < np.inf else _FLAT
                good = error * _SHARE * method.tolerance < likely
                work.rounded[0] += good
            if good and kinks.search.size > 0:
                part = unresolved_kink(problem, phase, begin, dt)
                if part < 1.0 and (adaptive or cuts < PIECES):
                    goal, cuts = done + part * dt, cuts + 1
                    continue
                if part < 1.0:
                    kinks.near[0] = UNFOUND
            if good and is_accompanied(problem):
                across = across_kinks(crossings, h)
                part = part_to_kink(problem, phase, begin, dt, h, across)
                length_to = shorter(part, dt, across)
                if length_to < dt:
                    goal, crossings = done + length_to, crossings + 1
                    continue
                if part < 0.0:
                    result = FORCE_JUMPS
                    break
                since = passed(since, part, dt)
                if since > 0.0:
                    goal = next_aim(done + dt, since, h)
            if good:
                near = kinks.near[0] if kinks.search.size > 0 else 0.0
                result = judge(unit, system, method, work, dt, h, near)
                if result == OK:
                    begin_interval(problem, begin, to, dt)
                    result = tell(problem, phase, END_STEP, 0, begin, 0.0)
                if result != OK:
                    break
                record_power(problem, phase, t, method.b.size, dt, ALL_FORCES)
                note_leap(system, work, phase, dt)
                accept(unit, system, work, phase)
                copy(problem.forces.bearings.force, phase.loads)
                done = aim if parts == 1.0 else done + dt
                length = max(length, factor * dt) if dt < length else factor * dt
                here, tries = False, 0
            else:
                before, longer = error, dt
                tries += 1
                unsettled += result == NOT_SETTLED
                length = factor * dt
                refused += result == NOT_CLOSED and work.crossing[1] > 0.0
                if refused > REFUSED:
                    break
                if length < (ENDED if result == JAMMED else _SHORTEST) * h:
                    if result != OK:
                        break
                    length, trial = BEYOND * h, True
        if adaptive:
            pace[0] = length
        if done < h:
            restore_grid_point(problem, phase)
            pace[0] = good_pace
            return result, taken, most
        save_grid_point(problem, phase)
        phase.step[0] = first + taken + 1
        leave_trail(work.trail, phase)
        good_pace = pace[0]
        if is_watched(work):
            zero(system.soft.weight)
            linearise(unit, system, work, work.q)
            if may_have_passed(problem, phase, end):
                return OK, taken + 1, most  # to be looked at
    return OK, steps, most

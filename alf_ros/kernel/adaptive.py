"""Steps as long as a tolerance allows, on a grid that is kept."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.arc_coordinates import straighten, straighten_momenta, turning
from alf_ros.kernel.data import (
    EPS,
    NOTHING,
    Method,
    Phase,
    Problem,
    Span,
    StepRecord,
    System,
    Tangents,
    Watch,
    Work,
)
from alf_ros.kernel.grazed_kinks import unresolved_kink
from alf_ros.kernel.interpolated_stages import SPACING, linearise_aside
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, ZERO, compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.singularity_monitor import may_have_passed
from alf_ros.kernel.status import (
    COLLAPSED,
    JAMMED,
    NOT_CLOSED,
    NOT_POSITIVE,
    OK,
    STOPPED,
    TOO_MANY,
)
from alf_ros.kernel.step import (
    accept,
    least_sigma,
    linearise_first,
    restore_grid_point,
    save_grid_point,
    step,
)
from alf_ros.kernel.step_error import free_part
from alf_ros.kernel.step_tape import record_step
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.tangent_step import carry_tangents
from alf_ros.kernel.work_ledger import ALL_FORCES, record_power

_SHARE = 0.05  # of the tolerance for one step: errors add up along a motion
_ROUNDED = EPS  # over x²: relative error of a step that may be rounding …
_FLAT = 1e-14  # … far from singular positions, over the ordinary σ …
_MOST_ROUNDED = 1e-10  # … and at most; ten times more if it stays
_DECAY = 2.5  # an error of order h⁴ that falls by less than this power of h belongs to a kink
_LEAP = 100.0  # times: an error that exceeds the previous one by so much, likewise
_ACROSS = 0.1  # part of the coarse error that counts where a kink is known to be in the step
_TURN = 1.5  # rad that an arm may turn in a step, so that turns can be counted
_MARGIN = 4.0  # as rounding is different in every step
ENDED = 1e-6  # part of the step of the grid up to which the end of a balance is found
REFUSED = 40  # attempts, where lengths miss a singular position: shorter steps do not help then
MOST = 20_000  # steps between two grid points: more is stiff, and would look like a hang


@inner
def embedded(method: Method, work: Work, rate: np.uint64, which: int, h: float) -> None:
    """sum = the embedded error `which` of the variable with rate number `rate` in `work.k`."""
    out, stages = work.sum, method.b.size
    n = out.size
    zero(out)
    for s in range(stages):
        weight = h * method.embedded[which * stages + s]
        if weight != 0.0:
            first = (THREE * s + rate) * n
            for i in range(n):
                out[i] += weight * work.k[first + i]


@inner
def relative(system: System, displacement: float, velocity: float, speed: float) -> float:
    """The larger of an error (m) relative to the size and one (m/s) relative to the speed."""
    worst = displacement / system.size
    if velocity > worst * speed:  # nothing is, at rest where nothing pulls
        worst = velocity / speed
    return worst


@inner
def _error_norm(
    unit: Unit, system: System, method: Method, work: Work, which: int, h: float, speed: float
) -> float:
    """Embedded error `which` of the step of h that ended in `work`."""
    embedded(method, work, ZERO, which, h)
    straighten(unit, system.arms, work.chart, work.sum)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.sum, work.p)
    displacement = free_part(unit, system, work)
    if work.chart.arcs[0] > 0:
        embedded(method, work, TWO, which, h)
        copy(work.sum, work.p)
        straighten_momenta(unit, system.arms, work.chart, work.p)
    else:
        embedded(method, work, ONE, which, h)
        zero(work.p)
        add_mass_times(unit, system.mass, 1.0, work.sum, work.p)
    return relative(system, displacement, free_part(unit, system, work), speed)


@inner
def _errors(
    unit: Unit,
    system: System,
    method: Method,
    work: Work,
    phase: Phase,
    h: float,
    share: float,
) -> tuple[float, float]:
    """Both relative errors of the step of h that ended in `work`, of order h⁶ and h⁴, in parts of
    `share`."""
    n = work.p.size
    pull = largest(work.Q, n) / system.mean
    speed = max(largest(phase.qd, n), largest(work.qd, n), np.sqrt(system.size * pull))
    if work.aside[0]:
        linearise_aside(unit, system, work)
    fine = _error_norm(unit, system, method, work, 0, h, speed) / share
    coarse = _error_norm(unit, system, method, work, 1, h, speed) / share
    if work.aside[0]:
        linearise(unit, system, work, work.q)
    if np.isfinite(fine) and np.isfinite(coarse):
        return fine, coarse
    return np.inf, np.inf


@inner
def _joined(fine: float, coarse: float) -> float:
    """Both errors as Hairer, Nørsett & Wanner (1993), II.10, join them for DOP853: of order h⁸, if
    the motion is smooth."""
    return fine * fine / np.sqrt(fine * fine + 0.01 * coarse * coarse) if fine > NOTHING else 0.0


@inner
def _likely_rounding(system: System, work: Work) -> float:
    """Relative error of the step that ended in `work`, up to which it may be rounding."""
    x = max(work.nearest[0], SPACING * system.close)  # nearer ones are interpolated from there
    return min(_MOST_ROUNDED, _FLAT / system.ordinary + _ROUNDED / (x * x))


@compiled
def advance_adaptively(
    problem: Problem,
    phase: Phase,
    watch: Watch | None,
    span: Span,
    within: bool,
    tangents: Tangents | None = None,
    record: StepRecord | None = None,
) -> tuple[int, int, int]:
    """Like `advance`, each h in as many steps as the tolerance of the method takes."""
    unit, system = problem.unit, problem.system
    method, work = problem.method, problem.work
    t0, first, steps, h = span
    pace, share = phase.pace, _SHARE * method.tolerance
    good_pace = pace[0]
    save_grid_point(problem, phase)
    if tangents is not None:
        copy(phase.tangents, tangents.good)
    most, begun = 0, False
    tries, before, longer = 0, np.inf, h  # from here; error and length of the last
    if not linearise_first(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    sigma = 0.0 if within else least_sigma(phase)
    for taken in range(steps):
        t, end = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        done, goal = 0.0, 0.0  # goal: where a step has to end besides the grid point
        result, tried, refused = OK, 0, 0
        floor = 1.0  # what rounding leaves of the error, whatever the step
        expected = np.inf  # the most that the coarse error is without a kink, with `longer`
        while done < h:
            tried += 1
            if tried > MOST:
                result = TOO_MANY
                break
            aim = goal if goal > done else h
            left = aim - done
            longest = pace[0]
            if not begun:
                longest = min(longest, _TURN / turning(unit, system.arms, phase))
            parts = max(1.0, np.ceil(0.999999 * left / longest))  # no crumb at the grid point
            dt = left / parts
            to = end if parts == 1.0 and aim == h else t + done + dt
            if not begun:
                work.sides[0] = np.nan
            work.sides[1] = 0.0
            result, count = step(problem, phase, t + done, to, dt, sigma, begun)
            most = max(most, count)
            if told_to_stop(work):
                result = STOPPED
                break
            fine, coarse, error, factor = np.inf, np.inf, np.inf, 0.5
            if result == OK:
                fine, coarse = _errors(unit, system, method, work, phase, dt, share)
            if fine < np.inf:
                error = _joined(fine, coarse)
                if work.sides[1] > 0.0:
                    error = max(fine, _ACROSS * coarse)
                if coarse > expected * (dt / longer) ** (_DECAY if tries > 0 else 4.0):
                    error = max(fine, coarse)
                part = error / floor
                factor = min(5.0, max(0.2, 0.8 * part ** (-1.0 / 8.0))) if part > 0.0 else 5.0
            # the error of a method falls as h⁸, rounding as h: then a shorter step is no
            # better
            stays = tries > 0 and fine > before * (dt / longer) ** 1.5
            likely = _likely_rounding(system, work) * (1.0 if tries < 2 else 10.0)
            if stays and error > floor and fine * share < likely:
                floor, factor = _MARGIN * error, 1.0
            if error <= floor and problem.forces.kinks.search.size > 0:
                part = unresolved_kink(problem, phase, t + done, dt)
                if part < 1.0:
                    goal, begun = done + part * dt, True
                    continue
            if error <= floor:
                if tangents is not None:
                    ended = work.q, work.qd, work.nearest[0]
                    result = carry_tangents(tangents, phase, ended, t + done, to, dt, sigma)
                    if result != OK:
                        break
                if record is not None:
                    record_step(record, phase, work, t + done, to, dt, sigma)
                record_power(problem, phase, t, method.b.size, dt, ALL_FORCES)
                accept(unit, system, work, phase)
                copy(problem.forces.bearings.force, phase.loads)
                done = aim if parts == 1.0 else done + dt
                pace[0] = max(pace[0], factor * dt) if dt < pace[0] else factor * dt
                work.rounded[0] += error > 1.0
                begun, sigma, tries = False, least_sigma(phase), 0
                expected, longer = _LEAP * max(coarse, 1.0), dt
            else:
                before, longer, expected = fine, dt, coarse
                begun = result == OK
                tries += 1
                pace[0] = factor * dt
                refused += result == NOT_CLOSED and work.crossing[1] > 0.0
                if refused > REFUSED:
                    break
                if pace[0] < (ENDED if result == JAMMED else 1e-9) * h:
                    result = result if result != OK else COLLAPSED
                    break
                if not begun:
                    copy(phase.q, work.q)
                    linearise(unit, system, work, work.q)
        if done < h:
            restore_grid_point(problem, phase)
            if tangents is not None:
                copy(tangents.good, phase.tangents)
            pace[0] = good_pace
            return result, taken, most
        save_grid_point(problem, phase)
        if tangents is not None:
            copy(phase.tangents, tangents.good)
        phase.step[0] = first + taken + 1
        good_pace = pace[0]
        if watch is not None:  # known at compilation: code without watching omits it
            if may_have_passed(problem, phase, watch, end):
                return OK, taken + 1, most  # to be looked at
    return OK, steps, most

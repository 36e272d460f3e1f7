"""Steps as long as a tolerance allows, on a grid that is kept."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.arc_coordinates import straighten, straighten_momenta, turning
from alf_ros.kernel.data import NOTHING, Forces, Method, Phase, System, Watch, Work
from alf_ros.kernel.interpolated_stages import linearise_aside
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, ZERO, compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.singularity_monitor import note
from alf_ros.kernel.status import COLLAPSED, JAMMED, NOT_POSITIVE, OK, TOO_MANY
from alf_ros.kernel.step import accept, begin, fall_back, keep, least_sigma, step
from alf_ros.kernel.step_error import free_part
from alf_ros.kernel.work_ledger import ALL, tally

_SHARE = 0.05  # of the tolerance for one step: errors add up along a motion
_ROUNDING = 1e-10  # relative error of a step that may be rounding; ten times more if it stays
_TURN = 1.5  # rad that an arm may turn in a step, so that turns can be counted
_MARGIN = 4.0  # as rounding is different in every step
ENDED = 1e-6  # part of the step of the grid up to which the end of a balance is found
MOST = 20_000  # steps between two grid points: more is stiff, and would look like a hang


@inner
def embedded(method: Method, work: Work, rate: np.uint64, which: int, h: float) -> None:
    """sum = the embedded error `which` of what has the rate number `rate` in `work.k`."""
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
def _error(
    unit: Unit,
    system: System,
    method: Method,
    work: Work,
    phase: Phase,
    h: float,
    share: float,
) -> float:
    """Relative error of the step of h that ended in `work`, in parts of `share`.

    Both embedded errors as Hairer, Nørsett & Wanner (1993), II.10, join them for DOP853.
    """
    n = work.p.size
    pull = largest(work.Q, n) / system.mean
    speed = max(largest(phase.qd, n), largest(work.qd, n), np.sqrt(system.size * pull))
    if work.aside[0]:
        linearise_aside(unit, system, work)
    e5 = _error_norm(unit, system, method, work, 0, h, speed) / share
    e3 = _error_norm(unit, system, method, work, 1, h, speed) / share
    if work.aside[0]:
        linearise(unit, system, work, work.q)
    return e5 * e5 / np.sqrt(e5 * e5 + 0.01 * e3 * e3) if e5 > NOTHING else 0.0


@compiled
def advance_adaptively(
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
    """Like `advance`, each h in as many steps as the tolerance of the method takes."""
    pace, share = phase.pace, _SHARE * method.tolerance
    good_pace = pace[0]
    keep(forces, work, phase)
    most, begun = 0, False
    tries, before, longer = 0, np.inf, h  # from here; error and length of the last
    if not begin(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    sigma = 0.0 if within else least_sigma(phase)
    for taken in range(steps):
        t, end = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        done = 0.0
        result, tried = OK, 0
        floor = 1.0  # what rounding leaves of the error, whatever the step
        while done < h:
            tried += 1
            if tried > MOST:
                result = TOO_MANY
                break
            left = h - done
            longest = pace[0]
            if not begun:
                longest = min(longest, _TURN / turning(unit, system.arms, phase))
            parts = max(1.0, np.ceil(0.999999 * left / longest))  # no crumb at the grid point
            dt = left / parts
            to = end if parts == 1.0 else t + done + dt
            result, count = step(
                unit, system, forces, method, work, phase, t + done, to, dt, sigma, begun
            )
            most = max(most, count)
            error, factor = np.inf, 0.5
            if result == OK:
                error = _error(unit, system, method, work, phase, dt, share)
            if np.isfinite(error):
                part = error / floor
                factor = min(5.0, max(0.2, 0.8 * part ** (-1.0 / 8.0))) if part > 0.0 else 5.0
            # the error of a method falls as h⁸, that of rounding as h: then a shorter step is no
            # better
            stays = tries > 0 and error > before * (dt / longer) ** 1.5
            likely = _ROUNDING if tries < 2 else 10.0 * _ROUNDING
            if stays and error > floor and error * share < likely:
                floor, factor = _MARGIN * error, 1.0
            if error <= floor:
                tally(forces.ledger.tally, system, forces, work, phase, t, method.b.size, dt, ALL)
                accept(unit, system, work, phase)
                copy(forces.bearings.force, phase.loads)
                done = h if parts == 1.0 else done + dt
                pace[0] = max(pace[0], factor * dt) if dt < pace[0] else factor * dt
                work.rounded[0] += error > 1.0
                begun, sigma, tries = False, least_sigma(phase), 0
            else:
                before, longer = error, dt
                begun = result == OK
                tries += 1
                pace[0] = factor * dt
                if pace[0] < (ENDED if result == JAMMED else 1e-9) * h:
                    result = result if result != OK else COLLAPSED
                    break
                if not begun:
                    copy(phase.q, work.q)
                    linearise(unit, system, work, work.q)
        if done < h:
            fall_back(forces, work, phase)
            pace[0] = good_pace
            return result, taken, most
        keep(forces, work, phase)
        good_pace = pace[0]
        if watch is not None:  # known when it is compiled: who does not watch does without
            if note(unit, system, work, watch, phase, end):
                return OK, taken + 1, most  # to be looked at
    return OK, steps, most

"""Steps as long as a tolerance allows, on a grid that is kept."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.data import (
    COLLAPSED,
    NOT_POSITIVE,
    OK,
    ONE,
    TOO_MANY,
    Forces,
    Method,
    Phase,
    System,
    Watch,
    Work,
)
from alf_ros.kernel.factor import linearise
from alf_ros.kernel.iteration import augmented, momentum_rate
from alf_ros.kernel.jit import compiled, inner
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.step import accept, begin, step
from alf_ros.kernel.vectors import copy, largest, zero
from alf_ros.kernel.watch import note

_SHARE = 0.05  # of the tolerance for one step: errors add up along a motion
_MOST = 20_000  # steps between two grid points: more is stiff, and would look like a hang
_FLOOR = 0.1  # part of the speed that the forces would give it along its size


@inner
def _error_norm(
    unit: Unit, system: System, method: Method, work: Work, phase: Phase, which: int, h: float
) -> float:
    """Embedded error `which` of q and p'.

    It is relative to the size for q, and to the speed for p': what is much slower than the forces
    would make it counts as a tenth of that, or rounding would be too large an error. Only the part
    along the free directions counts, by the factor of the end of the step: what is across is
    removed by the projection, and is where a singular position is felt first.
    """
    n = work.p.size
    weights = method.b.size + ONE
    worst = 0.0
    for part in range(2):
        k = work.kq if part == 0 else work.kp
        zero(work.sum_q)
        for s in range(weights):
            weight = method.embedded[which * weights + s]
            if weight != 0.0:
                for i in range(n):
                    work.sum_q[i] += h * weight * k[s * n + i]
        if part == 0:
            zero(work.momenta)
            add_mass_times(unit, system.mass, 1.0, work.sum_q, work.momenta)
            scale = system.size
        else:
            pull = largest(work.Q, n) / system.mean
            scale = _FLOOR * np.sqrt(system.size * pull)
            for i in range(n):
                work.momenta[i] = work.sum_q[i]
                scale = max(scale, max(abs(phase.qd[i]), abs(work.qd[i])), h * abs(work.qdd[i]))
        zero(work.r2)
        zero(work.y)
        zero(work.bend)
        augmented(unit, system, work, work.momenta, work.bend, 3, 1e-3, 1.0)
        for i in range(n):
            if abs(work.bend[i]) > worst * scale:
                worst = abs(work.bend[i]) / scale
    return worst


@inner
def _error(
    unit: Unit,
    system: System,
    forces: Forces,
    method: Method,
    work: Work,
    phase: Phase,
    t: float,
    h: float,
) -> float:
    """Error of the step that ended at t in `work`, in parts of what is allowed.

    Both embedded errors as Hairer, Nørsett & Wanner (1993), II.10, join them for DOP853.
    """
    n, stages = work.p.size, method.b.size
    work.evaluations[0] += 1
    iterations = np.int64(method.iterations)
    count, _sigma = momentum_rate(unit, system, forces, work, t, iterations, True)
    if count < 0:
        return np.inf
    for i in range(n):
        work.kq[stages * n + i] = work.qd[i]
        work.kp[stages * n + i] = work.p[i]
    allowed = _SHARE * method.tolerance
    e5 = _error_norm(unit, system, method, work, phase, 0, h) / allowed
    e3 = _error_norm(unit, system, method, work, phase, 1, h) / allowed
    return e5 * e5 / np.sqrt(e5 * e5 + 0.01 * e3 * e3) if e5 > 0.0 else 0.0


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
) -> tuple[int, int, int]:
    """Like `advance`, each h in as many steps as the tolerance of the method takes."""
    pace = phase.pace
    good_pace = pace[0]
    copy(phase.q, work.good_q)
    copy(phase.qd, work.good_qd)
    copy(phase.turns, work.good_turns)
    most = 0
    if not begin(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    for taken in range(steps):
        t = t0 + (first + taken) * h
        done = 0.0
        result = OK
        tried = 0
        while done < h:
            tried += 1
            if tried > _MOST:
                result = TOO_MANY
                break
            left = h - done
            last = pace[0] > 0.999999 * left
            dt = pace[0]
            if last:
                dt = left
            elif dt > 0.5 * left:  # no crumb before the grid point
                dt = 0.5 * left
            result, count = step(unit, system, forces, method, work, phase, t + done, dt)
            most = max(most, count)
            error = np.inf
            if result == OK:
                error = _error(unit, system, forces, method, work, phase, t + done + dt, dt)
            factor = 0.5
            if np.isfinite(error):
                factor = min(5.0, max(0.2, 0.9 * error ** (-1.0 / 8.0))) if error > 0.0 else 5.0
            if error <= 1.0:
                accept(unit, system, work, phase)
                done = h if last else done + dt
                pace[0] = max(pace[0], factor * dt) if dt < pace[0] else factor * dt
            else:
                pace[0] = factor * dt
                if pace[0] < 1e-9 * h:
                    result = result if result != OK else COLLAPSED
                    break
                copy(phase.q, work.q)
                linearise(unit, system, work, work.q)
        if done < h:
            copy(work.good_q, phase.q)
            copy(work.good_qd, phase.qd)
            copy(work.good_turns, phase.turns)
            pace[0] = good_pace
            return result, taken, most
        copy(phase.q, work.good_q)
        copy(phase.qd, work.good_qd)
        copy(phase.turns, work.good_turns)
        good_pace = pace[0]
        if watch is not None:  # known when it is compiled: who does not watch does without
            note(unit, system, forces, work, watch, taken, t + h)
    return OK, steps, most

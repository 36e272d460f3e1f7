"""One step of an explicit Runge-Kutta method, and many of them in one call."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.constraints import violation
from alf_ros.kernel.data import (
    JAMMED,
    NOT_CLOSED,
    NOT_FINITE,
    NOT_POSITIVE,
    OK,
    ONE,
    Forces,
    Method,
    Phase,
    System,
    Watch,
    Work,
)
from alf_ros.kernel.factor import linearise
from alf_ros.kernel.iteration import augmented, momentum_rate, unforced, velocities
from alf_ros.kernel.jit import compiled, expanded, inner
from alf_ros.kernel.manifold import project
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import SPACING, stage, stage_between
from alf_ros.kernel.turns import count_turns, nearby
from alf_ros.kernel.vectors import copy, largest, zero
from alf_ros.kernel.watch import note

_BLIND = 1e-6  # distance to a singular position from which on a stage's velocity is its direction


@expanded
def step(
    unit: Unit,
    system: System,
    forces: Forces,
    method: Method,
    work: Work,
    phase: Phase,
    t: float,
    h: float,
) -> tuple[int, int]:
    """One step from q, q̇ of `phase`, whose Φ_q and factor stand in `work`.

    Leaves the new q, q̇ in `work`, with Φ_q and factor. Returns (result, most iterations).
    """
    n = work.p.size
    q, qd, kq, kp = phase.q, phase.qd, work.kq, work.kp
    stages, iterations = method.b.size, np.int64(method.iterations)
    copy(qd, work.qd)
    prescribe(system, t, work.q, work.qd, work.qdd)
    unforced(unit, system, work)
    zero(work.bend)
    zero(work.p)
    most, _ratio = augmented(unit, system, work, work.p, work.bend, iterations, 1e-3, 1.0)
    fastest, hardest = largest(qd, n), 0.0
    radius, close = system.size, system.close
    bend = largest(work.bend, n)
    if fastest * fastest < radius * bend:
        radius = fastest * fastest / bend
    for s in range(stages + ONE):
        for i in range(n):
            work.q[i] = 0.0
            work.p[i] = 0.0
        for m in range(s):
            weight = method.a[s * stages + m] if s < stages else method.b[m]
            if weight != 0.0:
                for i in range(n):
                    work.q[i] += weight * kq[m * n + i]
                    work.p[i] += weight * kp[m * n + i]
        for i in range(n):
            work.q[i] = q[i] + h * work.q[i]
            work.p[i] *= h
        add_mass_times(unit, system.mass, 1.0, qd, work.p)
        copy(work.p, work.momenta)
        if s == stages:
            break
        ts = t + method.c[s] * h
        prescribe(system, ts, work.q, work.qd, work.qdd)
        copy(work.q, work.base)
        copy(work.q, work.target)
        # how far the stage is behind the path, in h² of its curvature
        lag = 0.5 * method.c[s] * method.c[s]
        for m in range(s):
            lag -= method.a[s * stages + m] * method.c[m]
        for i in range(n):
            work.q[i] += h * h * lag * work.bend[i]
        if s == 0:
            work.evaluations[0] += 1
            count, sigma = momentum_rate(unit, system, forces, work, ts, iterations, True)
            copy(work.qdd, work.pull)
            hardest = largest(work.qdd, n)
            # rounding is felt as v² / x³: what is slow may be closer
            if fastest * fastest < radius * hardest:
                close *= (fastest * fastest / (radius * hardest)) ** (1.0 / 3.0)
            x = sigma / system.ordinary
            clear = x > close
        else:
            count, x, clear = stage(
                unit, system, forces, work, ts, radius, close, False, iterations
            )
        if not clear and count > 0:
            moved = 0.0
            for i in range(n):
                moved = max(moved, abs(work.q[i] - work.base[i]))
            spacing = max(20.0 * moved, SPACING * system.close * radius)
            # along the branch, which the velocity tells unless it is too close for that; from
            # rest it is left along the acceleration
            along, moving = work.pull, False
            if fastest * fastest > 1e-6 * hardest * system.size:
                along, moving = qd, True
                if x > _BLIND:
                    copy(work.qd, work.along)
                    along = work.along
            count = stage_between(
                unit,
                system,
                forces,
                work,
                ts,
                along,
                moving,
                radius,
                close,
                spacing,
                iterations,
            )
            if s == 0:
                copy(qd, work.qd)
        if count <= 0:
            return JAMMED if count < 0 else NOT_CLOSED, most
        most = max(most, count)
        for i in range(n):
            kq[s * n + i] = work.qd[i]
            kp[s * n + i] = work.p[i]
    prescribe(system, t + h, work.q, work.qd, work.qdd)
    result = project(unit, system, work)
    if result == OK:
        copy(work.momenta, work.p)
        count, _sigma = velocities(unit, system, work, iterations, True)
        most = max(most, count)
        check = 0.0
        for i in range(n):
            check += work.q[i] + work.qd[i]
        if not np.isfinite(check):
            result = NOT_FINITE
    return result, most


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
    return linearise(unit, system, work, work.q)


@inner
def accept(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """Take the end of a step that went well as the new phase."""
    violation(unit, system.angles, work.q, work.angle)
    count_turns(work.angle_before, work.angle, phase.turns)
    copy(work.angle, work.angle_before)
    nearby(work.angle, phase.turns, work.near)
    copy(work.q, phase.q)
    copy(work.qd, phase.qd)


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
) -> tuple[int, int, int]:
    """Take `steps` steps of h from step number `first`; returns (result, taken, most iterations).

    `phase` is the state, in and out; on failure it holds the last good step. `watch` has room for
    all steps.
    """
    most = 0
    if not begin(unit, system, work, phase):
        return NOT_POSITIVE, 0, most
    for taken in range(steps):
        t = t0 + (first + taken) * h
        result, count = step(unit, system, forces, method, work, phase, t, h)
        most = max(most, count)
        if result != OK:
            return result, taken, most
        accept(unit, system, work, phase)
        if watch is not None:  # known when it is compiled: who does not watch does without
            note(unit, system, forces, work, watch, taken, t + h)
    return OK, steps, most

"""Fixed steps of any explicit Runge-Kutta method, for any formulation: ẏ = rates(t, y)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Forces, Method, Phase, System, Work
from alf_ros.kernel.kinks_over_time import piece_to_kink, stage_time
from alf_ros.kernel.numba_ext.jit import ONE, expanded, inner
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.projection import opening_without_slips
from alf_ros.kernel.status import FOLDED, NOT_FINITE, OK, OPENED, STOPPED
from alf_ros.kernel.step import accept, store_angles
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.simulation.formulations.storage import Storage

_TORN = 0.1  # opening of a constraint, relative to the mechanism, that ends a run


# Expanded into the `advance` of each formulation: only so can a compiled function be handed to it
# and the whole be cached, which is why those functions are alike.
@expanded
def runge_kutta(
    rates: Callable[..., Any],
    unit: Unit,
    system: System,
    forces: Forces,
    method: Method,
    work: Work,
    storage: Storage,
    phase: Phase,
    y: Floats,
    t0: float,
    first: int,
    steps: int,
    h: float,
) -> tuple[int, int, int]:
    """Take `steps` steps of h from step number `first`; returns (result, taken, most iterations).

    y is the state, in and out, and `phase` goes with it; on failure they belong to the last usable
    step. `rates` takes the state of a stage in storage.y, leaves its rates in storage.k and its q
    and q̇ in `work`. A step with kinks over time between its ends is taken in pieces.
    """
    N, stages, start = np.uint64(y.size), method.b.size, np.uint64(0)
    k, ys, base = storage.k, storage.y, storage.base
    store_angles(unit, system, work, phase)
    copy(phase.q, work.q)  # with the fixed points
    copy(phase.qd, work.qd)
    for i in range(N):
        ys[i] = y[i]
    prescribe(system, t0 + first * h, work.q, work.qd, work.qdd)
    result, most = rates(unit, system, forces, work, storage, t0 + first * h, start)
    if result != OK:
        return result, 0, most
    for taken in range(steps):
        t, last = t0 + (first + taken) * h, t0 + (first + taken + 1) * h
        done, aim = 0.0, h  # aim: where the piece of the step ends
        copy(y, base)
        while True:
            begin, to, aim = piece_to_kink(forces.kinks.instants, t, last, h, done, aim)
            dt = aim - done
            # the rates at the end of a piece are the ones of the next first stage, but for kinks
            fresh = begin != t
            for s in range(start if fresh else ONE, stages + ONE):
                end = s == stages
                for i in range(N):
                    rate = 0.0
                    for m in range(s):
                        rate += (method.b[m] if end else method.a[s * stages + m]) * k[m * N + i]
                    ys[i] = base[i] + dt * rate
                at = start if end else s
                ts = last if end and aim == h else to
                if not end:
                    ts = stage_time(begin, to, dt, method.c[s])
                prescribe(system, ts, work.q, work.qd, work.qdd)
                result, count = rates(unit, system, forces, work, storage, ts, at)
                work.evaluations[0] += 1
                most = max(most, count)
                if told_to_stop(work):
                    return STOPPED, taken, most
                if end or result != OK:
                    result = _judged(unit, system, work, storage, result)
                if result != OK:
                    return result, taken, most
            copy(ys, base)
            if aim == h:
                break
            done, aim = aim, h
        copy(base, y)
        accept(unit, system, work, phase)
        phase.step[0] = first + taken + 1
    return OK, steps, most


@inner
def _judged(unit: Unit, system: System, work: Work, storage: Storage, result: int) -> int:
    """Return the fault of a state: that it has diverged, which is more specific, or `result`."""
    if result == FOLDED:
        return result
    check = 0.0
    for i in range(storage.y.size):
        check += storage.y[i]
    if not np.isfinite(check):
        return NOT_FINITE
    if opening_without_slips(unit, system.rows, work.q, storage.phi) > _TORN * system.size:
        return OPENED
    return result

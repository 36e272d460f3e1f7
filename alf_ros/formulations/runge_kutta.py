"""Fixed steps of any explicit Runge-Kutta method, for any formulation: ẏ = rates(t, y)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Indices, Integers, Unit
from alf_ros.formulations.storage import FOLDED, OPENED, Storage, expanded, inner
from alf_ros.kernel import NOT_FINITE, OK, Forces, System, Work, copy, count_turns, opening

_TORN = 0.1  # opening of a constraint, relative to the mechanism, that ends a run


@inner
def judge(
    unit: Unit, system: System, work: Work, storage: Storage, result: int, size: float
) -> int:
    """Return what is wrong with the state in `storage`: if it has run away, that, else `result`."""
    check = 0.0
    for i in range(np.uint64(storage.y.size)):
        check += storage.y[i] + storage.k[i]
    if not np.isfinite(check):
        return NOT_FINITE
    if opening(unit, system.rows, work.q, work.r2) > _TORN * size:
        return OPENED
    return result


@expanded
def runge_kutta(
    rates: Callable[..., Any],
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    storage: Storage,
    a: Floats,
    b: Floats,
    c: Floats,
    axes: Indices,
    y: Floats,
    q: Floats,
    qd: Floats,
    turns: Integers,
    t0: float,
    first: int,
    steps: int,
    h: float,
    iterations: int,
    size: float,
) -> tuple[int, int, int]:
    """Take `steps` steps of h from step number `first`; returns (result, taken, most iterations).

    y is the state, in and out, with its positions q and velocities q̇ (all blocks D) and the turns
    of the bodies; on failure they are those of the last step that could be gone on from.

    `rates` takes the state in storage.y, leaves its rates in storage.k, at the stage it is told,
    and its q and q̇ in `work`.
    """
    N, stages = np.uint64(y.size), np.uint64(b.size)
    k, ys = storage.k, storage.y
    copy(q, work.q)  # with the fixed points
    copy(qd, work.qd)
    copy(y, ys)
    start = np.uint64(0)
    result, most = rates(unit, system, forces, work, storage, t0 + first * h, start, iterations)
    if result != OK:
        return result, 0, most
    for taken in range(steps):
        t = t0 + (first + taken) * h
        for s in range(np.uint64(1), stages + np.uint64(1)):
            end = s == stages
            for i in range(N):
                rate = 0.0
                for m in range(s):
                    rate += (b[m] if end else a[s * stages + m]) * k[m * N + i]
                ys[i] = y[i] + h * rate
            # the rates at the end are those of the first stage of the next step
            to = start if end else s
            ts = t0 + (first + taken + 1) * h if end else t + c[s] * h
            result, count = rates(unit, system, forces, work, storage, ts, to, iterations)
            if result != FOLDED and (end or result != OK):
                result = judge(unit, system, work, storage, result, size)
            if result != OK:
                return result, taken, most
            most = max(most, count)
        copy(ys, y)
        count_turns(axes, q, work.q, turns)
        copy(work.q, q)
        copy(work.qd, qd)
    return OK, steps, most

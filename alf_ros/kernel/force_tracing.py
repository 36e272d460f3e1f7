"""The trace of all forces at a stage (`traced_numbers`), and how it is read backwards."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Effects, ForceTrace, Work
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.traced_words import ARGUMENTS, COUNT, FIRST, ROOM


@inner
def trace_forces(trace: ForceTrace, effects: Effects, work: Work, t: float) -> bool:
    """Write the trace of all forces at q, q̇ in `work`; returns whether it fits."""
    words, whole = trace.words, trace.Q.size
    for a in range(whole):
        trace.Q[a], trace.made[a], trace.along[a] = 0.0, -1, 0.0
    words[COUNT] = 0
    for e in range(effects.force.size):
        call(
            trace.force[e],
            t,
            work.q,
            work.qd,
            work.near,
            effects.slots,
            effects.slots_at[e],
            effects.params,
            effects.params_at[e],
            trace.numbers,
            trace.numbers,
            whole,
            trace.numbers,
            whole + whole + np.uint64(effects.params_at[e]),
            trace.Q,
            trace.made,
            trace.along,
            words,
            trace.slopes,
        )
    return words[COUNT] <= words[ROOM]


@inner
def read_backwards(trace: ForceTrace, by_force: Floats, n: np.uint64, bar: Floats) -> None:
    """∂J/∂ of the leaves and operations, added to `bar`, from ∂J/∂Q (n,). The part of the
    operations is zeroed first."""
    words, slopes = trace.words, trace.slopes
    leaves, count = words[ARGUMENTS], words[COUNT]
    for k in range(count):
        bar[leaves + k] = 0.0
    for a in range(n):
        if trace.made[a] >= 0:
            bar[trace.made[a]] += trace.along[a] * by_force[a]
    for back in range(count):
        k = count - 1 - back
        of = bar[leaves + k]
        if of != 0.0:
            for m in range(2):
                number = words[FIRST + 2 * k + m]
                if number >= 0:
                    bar[number] += of * slopes[2 * k + m]

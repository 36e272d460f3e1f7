"""∂J/∂ of the numbers that forces depend on, column by column (`ForceColumns`).

A small mechanism has so few coordinates that two registers hold a slope for each of them. To
compute these with the force takes less time than to write its operations down and to read them
backwards.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Effects, ForceColumns, Work
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ZERO, inner
from alf_ros.kernel.numba_ext.lane_structs import lane
from alf_ros.kernel.numba_ext.vectors import zero


@inner
def add_columns(
    columns: ForceColumns, effects: Effects, work: Work, t: float, by_force: Floats, bar: Floats
) -> None:
    """Add (∂Q/∂x)ᵀ ∂J/∂Q at q, q̇ in `work` to `bar` for numbers x of the state, and to `own` for
    numbers of the effects; by_force: ∂J/∂Q (movable D,)."""
    dQ = columns.dQ
    zero(columns.sum)
    zero(columns.Q)
    for e in range(np.uint64(effects.force.size)):
        zero(dQ)
        call(
            columns.force[e],
            t,
            work.q,
            columns.dq,
            work.qd,
            columns.dqd,
            work.near,
            effects.slots,
            effects.slots_at[e],
            effects.params,
            effects.params_at[e],
            columns.dparams,
            effects.params_at[e],
            columns.Q,
            dQ,
        )
        total = 0.0 * columns.sum[0]
        for a in range(work.p.size):
            if by_force[a] != 0.0:  # a slope that does not count may be infinite
                total += by_force[a] * dQ[a]
        columns.own[e] += total
        columns.sum[0] += total
    for m in range(np.uint64(columns.number.size)):
        bar[columns.number[m]] += lane(columns.sum, ZERO, m)

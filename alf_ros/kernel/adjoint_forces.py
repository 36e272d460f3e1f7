"""∂J/∂q, ∂J/∂q̇ and ∂J/∂(numbers of the effects) from ∂J/∂Q, by the traces of all forces."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.traced_words import ARGUMENTS, COUNT, FIRST, ROOM
from alf_ros.kernel.numba_ext.vectors import zero


@inner
def take_forces_back(
    adjoint: Adjoint, t: float, by_force: Floats, by_q: Floats, by_qd: Floats
) -> int:
    """Add (∂Q/∂q)ᵀ and (∂Q/∂q̇)ᵀ of ∂J/∂Q (movable D,) at q, q̇ in `work` to `by_q` and `by_qd`, and
    what belongs to the numbers of the effects to `of_trace`. 0 if the trace is full."""
    problem = adjoint.tangents.problem
    work, effects = problem.work, problem.forces.effects
    words, slopes, bar = adjoint.words, adjoint.slopes, adjoint.of_trace
    n, whole, leaves = work.p.size, work.q.size, words[ARGUMENTS]
    for a in range(whole):
        bar[a], bar[whole + a] = 0.0, 0.0
    for e in range(effects.force.size):
        zero(adjoint.Q)
        for a in range(whole):
            adjoint.made[a] = -1
        words[COUNT] = 0
        call(
            adjoint.force[e],
            t,
            work.q,
            work.qd,
            work.near,
            effects.slots,
            effects.slots_at[e],
            effects.params,
            effects.params_at[e],
            np.int64(whole),
            np.int64(whole + whole + effects.params_at[e]),
            adjoint.Q,
            adjoint.made,
            words,
            slopes,
        )
        count = words[COUNT]
        if count > words[ROOM]:
            return 0
        for k in range(count):
            bar[leaves + k] = 0.0
        for a in range(n):
            if adjoint.made[a] >= 0:
                bar[adjoint.made[a]] += by_force[a]
        for back in range(count):
            k = count - 1 - back
            of = bar[leaves + k]
            if of != 0.0:
                for m in range(2):
                    number = words[FIRST + 2 * k + m]
                    if number >= 0:
                        bar[number] += of * slopes[2 * k + m]
    for a in range(whole):
        by_q[a] += bar[a]
        by_qd[a] += bar[whole + a]
    return 1

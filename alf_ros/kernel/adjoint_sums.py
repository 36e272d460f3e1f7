"""The sums of a step, transposed: δq and δq̇ of a stage are the ones of the begin and the weighed
rates of the stages before."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.numba_ext.jit import TWO, inner


@inner
def take_sum_back(adjoint: Adjoint, by_q: Floats, by_qd: Floats, s: np.uint64, h: float) -> None:
    """∂J/∂(δq, δq̇) of stage s as the step adds them up, or of its end, into the ones of its begin
    and of the rates of the stages before."""
    problem, rates, start = adjoint.tangents.problem, adjoint.rates, adjoint.start
    method, n = problem.method, problem.work.p.size
    stages = method.b.size
    for a in range(n):
        start[a] += by_q[a]
        start[n + a] += by_qd[a]
    for m in range(s):
        weight = h * (method.a[s * stages + m] if s < stages else method.b[m])
        if weight != 0.0:
            at = TWO * m * n
            for a in range(n):
                rates[at + a] += weight * by_q[a]
                rates[at + n + a] += weight * by_qd[a]


@inner
def take_fixed_back(adjoint: Adjoint) -> None:
    """∂J/∂δq of fixed blocks, in `q`, which all stages have in common."""
    for a in range(adjoint.tangents.problem.work.p.size, adjoint.q.size):
        adjoint.bar_q[a] += adjoint.q[a]

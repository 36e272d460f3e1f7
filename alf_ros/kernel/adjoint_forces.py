"""∂J/∂q, ∂J/∂q̇ and ∂J/∂(numbers of the effects) from ∂J/∂Q, by the columns of all forces, or by
their trace."""

from __future__ import annotations

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.force_columns import add_columns
from alf_ros.kernel.force_tracing import read_backwards, trace_forces
from alf_ros.kernel.numba_ext.jit import inner


@inner
def take_forces_back(
    adjoint: Adjoint, t: float, by_force: Floats, by_q: Floats, by_qd: Floats
) -> int:
    """Add (∂Q/∂q)ᵀ and (∂Q/∂q̇)ᵀ of ∂J/∂Q (movable D,) at q, q̇ in `work` to `by_q` and `by_qd`, and
    what belongs to the numbers of the effects to `of_trace`. 0 if the trace is full."""
    problem, bar = adjoint.tangents.problem, adjoint.of_trace
    work, whole = problem.work, problem.work.q.size
    for a in range(whole):
        bar[a], bar[whole + a] = 0.0, 0.0
    if adjoint.columns.force.size > 0:
        add_columns(adjoint.columns, problem.forces.effects, work, t, by_force, bar)
    elif trace_forces(adjoint.trace, problem.forces.effects, work, t):
        read_backwards(adjoint.trace, by_force, work.p.size, bar)
    else:
        return 0
    for a in range(whole):
        by_q[a] += bar[a]
        by_qd[a] += bar[whole + a]
    return 1

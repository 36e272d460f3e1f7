"""∂J/∂q, ∂J/∂q̇ and ∂J/∂(numbers of the effects) from ∂J/∂Q, by the columns of all forces, or by
their trace."""

from __future__ import annotations

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.force_columns import add_columns
from alf_ros.kernel.force_tracing import read_backwards, trace_forces
from alf_ros.kernel.numba_ext.jit import TWO, inner


@inner
def take_forces_back(
    adjoint: Adjoint, t: float, by_force: Floats, by_q: Floats, by_qd: Floats
) -> int:
    """Add (∂Q/∂q)ᵀ and (∂Q/∂q̇)ᵀ of ∂J/∂Q (movable D,) at q, q̇ in `work` to `by_q` and `by_qd`, and
    what belongs to the numbers of the effects to `of_trace`. 0 if the trace is full."""
    bar, effects = adjoint.of_trace, adjoint.tangents.problem.forces.effects
    if adjoint.columns.force.size > 0:
        _begin(adjoint)
        work = adjoint.tangents.problem.work
        add_columns(adjoint.columns, effects, work, t, by_force, bar)
        _add(adjoint, by_q, by_qd)
        return 1
    if not trace_stage(adjoint, t):
        return 0
    read_trace_back(adjoint, by_force, by_q, by_qd)
    return 1


@inner
def trace_stage(adjoint: Adjoint, t: float) -> bool:
    """Write the trace of all forces at q, q̇ in `work`; returns whether it fits."""
    problem = adjoint.tangents.problem
    return trace_forces(adjoint.trace, problem.forces.effects, problem.work, t)


@inner
def read_trace_back(adjoint: Adjoint, by_force: Floats, by_q: Floats, by_qd: Floats) -> None:
    """The same as `take_forces_back`, by the trace of the stage."""
    _begin(adjoint)
    n = adjoint.tangents.problem.work.p.size
    read_backwards(adjoint.trace, by_force, n, adjoint.of_trace)
    _add(adjoint, by_q, by_qd)


@inner
def _begin(adjoint: Adjoint) -> None:
    """∂J/∂ of the numbers of the state: none yet."""
    for a in range(TWO * adjoint.q.size):
        adjoint.of_trace[a] = 0.0


@inner
def _add(adjoint: Adjoint, by_q: Floats, by_qd: Floats) -> None:
    whole, bar = adjoint.q.size, adjoint.of_trace
    for a in range(whole):
        by_q[a] += bar[a]
        by_qd[a] += bar[whole + a]

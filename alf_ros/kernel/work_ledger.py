"""The power of each effect, and of prescribed motions, at a stage; works are its integrals.

W_e = Σ h b_s Q_e·q̇ over the stages of all steps: one more state of the method, to its order.
Prescribed motions, blocks s(t), do the work Φ_q,sᵀ λ · ṡ, because Φ_q q̇ = -Φ_q,s ṡ.

The ledger is called through a function pointer, so it is not compiled unless requested.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import add_one, add_one_friction
from alf_ros.kernel.data import Ledger, Phase, Problem, System, Work
from alf_ros.kernel.numba_ext.block import block, dot
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, by_address, expanded, inner
from alf_ros.kernel.numba_ext.vectors import zero

# which forces are recorded at a stage: all; or, where the stage is interpolated, first those that
# do not depend on reactions, and then those that do, place by place
ALL_FORCES, APPLIED, REACTION_DEPENDENT = np.int64(0), np.int64(1), np.int64(2)


@expanded
def record_power(
    problem: Problem, phase: Phase, t: float, s: np.uint64, weight: float, part: int
) -> None:
    """If there is a ledger, record the power of each effect at stage s, as it stands in `work`,
    `weight` times; `part`: ALL_FORCES, APPLIED or REACTION_DEPENDENT.

    s past the last stage: the step, `weight` (s) long, counts.
    """
    call(problem.forces.ledger.tally, problem, phase, t, s, weight, part)


def _record(
    problem: Problem, phase: Phase, t: float, s: np.uint64, weight: float, part: int
) -> None:
    unit, forces, work = problem.unit, problem.forces, problem.work
    ledger, effects, accounts = forces.ledger, forces.ledger.effects, phase.works.size
    if s == ledger.weights.size:
        _integrate(ledger, phase.works, weight)
        return
    if ledger.weights[s] == 0.0:
        return
    first = s * accounts
    if part != REACTION_DEPENDENT:
        for a in range(first, first + accounts):
            ledger.rates[a] = 0.0
    for e in range(effects.force.size):
        zero(ledger.Q)
        if part != REACTION_DEPENDENT:
            add_one(effects, e, t, work.q, work.qd, work.near, ledger.Q)
        if part != APPLIED and effects.friction[e] != 0:
            loads = forces.bearings.loads
            add_one_friction(effects, e, t, work.q, work.qd, work.near, loads, ledger.Q)
        power = 0.0
        for i in range(ledger.Q.size):
            power += ledger.Q[i] * work.qd[i]
        ledger.rates[first + ledger.account[e]] += weight * power
    if part != APPLIED:
        power = _prescribed_power(unit, problem.system, work)
        ledger.rates[first + accounts - ONE] += weight * power


@inner
def _integrate(ledger: Ledger, works: Floats, h: float) -> None:
    """works += h Σ b_s W_s."""
    for a in range(works.size):
        for s in range(ledger.weights.size):
            if ledger.weights[s] != 0.0:
                works[a] += h * ledger.weights[s] * ledger.rates[s * works.size + a]


@inner
def _prescribed_power(unit: Unit, system: System, work: Work) -> float:
    """λᵀ Φ_q,s ṡ, W; fixed blocks do not move."""
    rows, m1, power = system.rows, system.rows.i.size, 0.0
    for r in range(rows.movable.size):
        for e in range(rows.movable[r], rows.first[r + ONE]):
            v = block(unit, work.qd, rows.block[e])
            power += work.y[m1 + r] * dot(block(unit, work.g2, e), v)
    return power


@cache
def record(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Ledger` holds."""
    structs = Problem._numba_type(dimension), Phase._numba_type()
    numbers = types.float64, types.uint64, types.float64, types.int64
    return by_address(types.void(*structs, *numbers))(_record)

"""The power of each effect, and of what is prescribed, at a stage; their works are its integrals.

W_e = Σ h b_s Q_e·q̇ over the stages of all steps: one more state of the method, to its order. What
is prescribed, blocks s(t), gives Φ_q,sᵀ λ · ṡ, for Φ_q q̇ = -Φ_q,s ṡ.

It is reached through its address, so that who keeps no ledger compiles none of this.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import add_one, add_one_friction
from alf_ros.kernel.data import Forces, Ledger, Phase, System, Work
from alf_ros.kernel.numba_ext.block import block, dot
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, by_address, inner
from alf_ros.kernel.numba_ext.vectors import zero

# what is noted of a stage: all of it; or, where it is interpolated, first what does not depend on
# reactions, and then what does, place by place
ALL, APPLIED, REACTING = np.int64(0), np.int64(1), np.int64(2)

# tally(ledger.tally, system, forces, work, phase, t, s, weight, part), if there is a ledger: note
# the power of each effect at stage s, as it stands in `work`, `weight` times; `part`: ALL, APPLIED
# or REACTING. Past the last stage: the step, `weight` (s) long, counts.
tally = call


@inner
def _note(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    s: np.uint64,
    weight: float,
    part: int,
) -> None:
    ledger, effects, accounts = forces.ledger, forces.ledger.effects, phase.works.size
    if s == ledger.weights.size:
        _count(ledger, phase.works, weight)
        return
    if ledger.weights[s] == 0.0:
        return
    first = s * accounts
    if part != REACTING:
        for a in range(first, first + accounts):
            ledger.rates[a] = 0.0
    for e in range(effects.force.size):
        zero(ledger.Q)
        if part != REACTING:
            add_one(effects, e, t, work.q, work.qd, work.near, ledger.Q)
        if part != APPLIED and effects.friction[e] != 0:
            loads = forces.bearings.loads
            add_one_friction(effects, e, t, work.q, work.qd, work.near, loads, ledger.Q)
        power = 0.0
        for i in range(ledger.Q.size):
            power += ledger.Q[i] * work.qd[i]
        ledger.rates[first + ledger.account[e]] += weight * power
    if part != APPLIED:
        ledger.rates[first + accounts - ONE] += weight * _prescribed(unit, system, work)


@inner
def _count(ledger: Ledger, works: Floats, h: float) -> None:
    for a in range(works.size):
        for s in range(ledger.weights.size):
            if ledger.weights[s] != 0.0:
                works[a] += h * ledger.weights[s] * ledger.rates[s * works.size + a]


@inner
def _prescribed(unit: Unit, system: System, work: Work) -> float:
    """λᵀ Φ_q,s ṡ; blocks that are fixed do not move."""
    rows, m1, power = system.rows, system.rows.i.size, 0.0
    for r in range(rows.movable.size):
        for e in range(rows.movable[r], rows.first[r + ONE]):
            v = block(unit, work.qd, rows.block[e])
            power += work.y[m1 + r] * dot(block(unit, work.g2, e), v)
    return power


def _in_plane(
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    s: np.uint64,
    weight: float,
    part: int,
) -> None:
    _note((0.0, 0.0), system, forces, work, phase, t, s, weight, part)


def _in_space(
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    s: np.uint64,
    weight: float,
    part: int,
) -> None:
    _note((0.0, 0.0, 0.0), system, forces, work, phase, t, s, weight, part)


@cache
def note(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Ledger` holds."""
    structs = [each._numba_type() for each in (System, Forces, Work, Phase)]
    numbers = types.float64, types.uint64, types.float64, types.int64
    return by_address(types.void(*structs, *numbers))(_in_plane if dimension == 2 else _in_space)

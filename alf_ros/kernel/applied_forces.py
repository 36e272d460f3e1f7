"""Q(q, q̇, t): the effects of a scene, called by their addresses."""

from __future__ import annotations

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.data import Effects, ForceDirection
from alf_ros.kernel.numba_ext.calls import call, call_for_number
from alf_ros.kernel.numba_ext.jit import compiled, expanded
from alf_ros.kernel.numba_ext.vectors import zero


@expanded
def add_one(
    effects: Effects, e: int, t: float, q: Floats, qd: Floats, near: Floats, Q: Floats
) -> None:
    """Q += the force of effect number e, except friction that depends on loads."""
    call(
        effects.force[e],
        t,
        q,
        qd,
        near,
        effects.slots,
        effects.slots_at[e],
        effects.params,
        effects.params_at[e],
        Q,
    )


@expanded
def add_one_friction(
    effects: Effects,
    e: int,
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    loads: Floats,
    Q: Floats,
) -> None:
    """Q += the friction of effect number e that depends on the loads (N) of joints."""
    call(
        effects.friction[e],
        t,
        q,
        qd,
        near,
        loads,
        effects.loads_at[e],
        effects.slots,
        effects.slots_at[e],
        effects.params,
        effects.params_at[e],
        Q,
    )


@compiled
def applied_forces(
    effects: Effects, t: float, q: Floats, qd: Floats, near: Floats, Q: Floats
) -> None:
    """Q(q, q̇, t): the sum of the effects the scene names; each adds its own."""
    zero(Q)
    for e in range(effects.force.size):
        add_one(effects, e, t, q, qd, near, Q)


@compiled
def sides(effects: Effects, t: float, q: Floats, qd: Floats, near: Floats) -> float:
    """A number that differs between the two sides of a kink of the forces."""
    total = 0.0
    for e in range(effects.side.size):
        if effects.side[e] != 0:
            total += (e + 1.0) * call_for_number(
                effects.side[e],
                t,
                q,
                qd,
                near,
                effects.slots,
                effects.slots_at[e],
                effects.params,
                effects.params_at[e],
            )
    return total


@compiled
def chosen_forces(
    effects: Effects,
    chosen: Integers,
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    Q: Floats,
) -> None:
    """Q(q, q̇, t) of some effects, by their numbers."""
    zero(Q)
    for n in range(chosen.size):
        add_one(effects, chosen[n], t, q, qd, near, Q)


@compiled
def force_change(
    effects: Effects, along: ForceDirection, t: float, q: Floats, qd: Floats, near: Floats
) -> None:
    """δQ of δq, δq̇ and δparams, exact to rounding, by the forces for dual numbers."""
    zero(along.Q)
    zero(along.dQ)
    for e in range(effects.force.size):
        if along.force[e] != 0:
            call(
                along.force[e],
                t,
                q,
                along.dq,
                qd,
                along.dqd,
                near,
                effects.slots,
                effects.slots_at[e],
                effects.params,
                effects.params_at[e],
                along.dparams,
                effects.params_at[e],
                along.Q,
                along.dQ,
            )


@compiled
def add_friction(
    effects: Effects, t: float, q: Floats, qd: Floats, near: Floats, loads: Floats, Q: Floats
) -> None:
    """Q += the friction of all effects that depends on the loads (N) of joints."""
    for e in range(effects.friction.size):
        if effects.friction[e] != 0:
            add_one_friction(effects, e, t, q, qd, near, loads, Q)


@compiled
def potential_energy(effects: Effects, t: float, q: Floats, near: Floats) -> float:
    """Potential energy of all effects that store some, J."""
    energy = 0.0
    for e in range(effects.force.size):
        if effects.potential[e] != 0:
            energy += call_for_number(
                effects.potential[e],
                t,
                q,
                near,
                effects.slots,
                effects.slots_at[e],
                effects.params,
                effects.params_at[e],
            )
    return energy

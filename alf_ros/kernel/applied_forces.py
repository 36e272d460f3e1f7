"""Q(q, q̇, t): the effects of a scene, called by their addresses."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Effects
from alf_ros.kernel.numba_ext.jit import compiled, expanded
from alf_ros.kernel.numba_ext.structs import VectorType
from alf_ros.kernel.numba_ext.vectors import zero


def call(context: Any, builder: Any, sig: Any, args: Any, returns: Any) -> Any:
    """Call a C function of a known signature at an address that is data."""
    values, offset = [], False
    for kind, value in zip(sig.args[1:], args[1:], strict=True):
        if isinstance(kind, (types.Array, VectorType)):
            data = cgutils.create_struct_proxy(kind)(context, builder, value=value).data
            values.append(data)
        elif offset and isinstance(kind, types.Integer):  # of the pointer before it
            values[-1] = builder.gep(values[-1], [value])
        else:
            values.append(value)
        offset = isinstance(kind, (types.Array, VectorType))
    function = ir.FunctionType(returns, [value.type for value in values])
    pointer = builder.inttoptr(args[0], function.as_pointer())
    return builder.call(pointer, values)


@intrinsic
def _force(
    typing: Any,
    at: Any,
    t: Any,
    q: Any,
    qd: Any,
    near: Any,
    slots: Any,
    i: Any,
    params: Any,
    j: Any,
    Q: Any,
) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        call(context, builder, sig, args, ir.VoidType())
        return context.get_dummy_value()

    return types.void(at, t, q, qd, near, slots, i, params, j, Q), code


@intrinsic
def _potential(
    typing: Any, at: Any, t: Any, q: Any, near: Any, slots: Any, i: Any, params: Any, j: Any
) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return call(context, builder, sig, args, ir.DoubleType())

    return types.float64(at, t, q, near, slots, i, params, j), code


@intrinsic
def _friction(
    typing: Any,
    at: Any,
    t: Any,
    q: Any,
    qd: Any,
    near: Any,
    loads: Any,
    n: Any,
    slots: Any,
    i: Any,
    params: Any,
    j: Any,
    Q: Any,
) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        call(context, builder, sig, args, ir.VoidType())
        return context.get_dummy_value()

    return types.void(at, t, q, qd, near, loads, n, slots, i, params, j, Q), code


@expanded
def add_one(
    effects: Effects, e: int, t: float, q: Floats, qd: Floats, near: Floats, Q: Floats
) -> None:
    """Q += what effect number e exerts without loads."""
    _force(
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
    """Q += what of it depends on the loads (N) of joints."""
    _friction(
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
def add_friction(
    effects: Effects, t: float, q: Floats, qd: Floats, near: Floats, loads: Floats, Q: Floats
) -> None:
    """Q += what depends on the loads (N) of joints."""
    for e in range(effects.friction.size):
        if effects.friction[e] != 0:
            add_one_friction(effects, e, t, q, qd, near, loads, Q)


@compiled
def potential_energy(effects: Effects, t: float, q: Floats, near: Floats) -> float:
    """Potential energy of all effects that store some, J."""
    energy = 0.0
    for e in range(effects.force.size):
        if effects.potential[e] != 0:
            energy += _potential(
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

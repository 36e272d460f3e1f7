"""What an effect is: one file in this folder, named after the effect, that holds

`Parameters`
    a frozen dataclass; every field's metadata says its `kind` ('number', 'vector', 'body',
    'point', 'joint', 'body or point', 'text', 'boolean'), `unit` and `doc`; fields with defaults
    are optional.
`MULTIPLE`
    whether a scene may name it several times.
`pack(effects, layout) -> Packed`
    all instances of the effect in a scene as two flat arrays, once, before the run.
`force(t, q, qd, slots, params, Q)`
    compiled by `@force`; ADDS its generalised forces into Q and only reads the rest. All blocks
    of the layout are in q, q̇ and Q, the fixed ones too, so that no effect has to ask which is
    which.
`potential(t, q, slots, params)` (optional)
    compiled by `@potential`; the energy stored, J.

The kernel calls both through their addresses: naming another set of effects compiles nothing but
the effects that are new. The arguments are pointers, so nothing is checked and nothing is
allocated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numba import cfunc, types

from alf_ros.arrays import Floats, Integers

_numbers = types.CPointer(types.float64)
_integers = types.CPointer(types.int64)
FORCE = types.void(types.float64, _numbers, _numbers, _integers, _numbers, _numbers)
POTENTIAL = types.float64(types.float64, _numbers, _integers, _numbers)


@dataclass(frozen=True)
class Effect:
    """An effect as a scene names it: `kind` is its file, `name` the instance."""

    kind: str
    name: str
    parameters: Any


@dataclass(frozen=True)
class Packed:
    """What the compiled functions of an effect read: `slots` are indices, `params` numbers."""

    slots: Integers
    params: Floats


def force(function: Callable[..., None]) -> Any:
    """Compile `force(t, q, qd, slots, params, Q)` of an effect; cached beside its file."""
    return cfunc(FORCE, cache=True)(function)


def potential(function: Callable[..., float]) -> Any:
    """Compile `potential(t, q, slots, params)` of an effect; cached beside its file."""
    return cfunc(POTENTIAL, cache=True)(function)

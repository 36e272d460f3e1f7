"""Contract of an effect: one file in this folder, named after the effect, that holds

`Parameters`
    a frozen dataclass; every field's metadata says its `kind` (see `scene_effects`), `unit` and
    `doc`; fields with defaults are optional.
`MULTIPLE`
    whether a scene may name it several times.
`ONE_OF` (optional)
    parameters of which a scene gives one at least, also as zero: without them it has no effect.
`pack(effects, layout) -> Packed`
    all instances of the effect in a scene as two flat arrays, once, before the run.
`force(t, q, qd, near, slots, params, Q)`
    compiled by `@force`; ADDS its generalised forces into Q and only reads the rest. All blocks
    of the layout are in q, q̇ and Q, the fixed ones too, so that no effect has to ask which is
    which. `near` holds every counted angle (`coordinates.measured`) with its turns, as it was
    where the step began, to a quarter turn: the angle a = atan2(y, x) of a stage plus
    2π round((near - a) / 2π) is continuous up to a quarter turn a step, and a function of the
    state.
`potential(t, q, near, slots, params)` (optional)
    compiled by `@potential`; the energy stored, J.
`friction(t, q, qd, near, loads, slots, params, Q)` and `loaded(parameters)` (optional)
    compiled by `@friction`: adds forces that depend on the reactions of joints, which they change.
    `loads` holds the size of one reaction (N) for each instance, the reaction of the joint or
    joint coordinate that `loaded` names; where it says None, zero. The kernel finds the loads and
    reactions that agree.

`side(t, q, qd, near, slots, params)` (optional)
    compiled by `@side`, for an adaptive explicit method: a number that differs between the two
    sides of each kink of the force. A step with a kink inside is then known. Derivatives look at
    the comparisons of a force without it (`force_branches`).
`interval(t, q, qd, near, slots, params, n, out)` (optional)
    compiled by `@interval`: where the kinks of a force that depends on places are. Writes into
    `out` the n-th of `Packed.intervals` scalars x, its rate ẋ, and the ends of the interval around
    x in which the force has no kink, infinite where there is none. A step in which x leaves its
    interval and returns is then known, even if no stage sees it.
    Kinks over time need neither: steps end at the times in `Packed.instants`.
`tangent(t, q, qd, near, loads, slots, params, n, stiff, G)` (optional)
    compiled by `@tangent`, for an implicit method that asks: how the effect yields in direction
    n, one of `Packed.directions`. Of an effort F on a scalar x: writes -∂F/∂x and -∂F/∂ẋ into
    `stiff`, and ADDS ∂x/∂q into G.

`HOLDS` and `held(name, what)` (optional)
    the roles of an effect for held commands, and its parameters then:
    WRENCH on a body or point, EFFORT on a joint that has one free axis, EFFORT_OVER_TIME on any
    joint coordinate. `effects.ROLES` says which file plays which.
`follows(parameters)` and `aimed(parameters, position, velocity)` (optional, see `controlled`)
    whether the effect follows a position and a velocity from outside, and its parameters when it
    is given them. They are given by the name of the coordinate `parameters.joint`, or else by its
    own.
`unlimited(parameters)` (optional)
    without the limits of its force, which hide for a while that it jumps at an instant.
`on_axis(parameters, coordinate)` (optional)
    of an effect on several joint coordinates: parameters of its part on one of them.
`CONSTANT` (optional)
    True if the force depends neither on time nor on the motion.
`free_fall(parameters)` (optional)
    the acceleration, m/s², that it gives every mass alike: accelerometers do not feel it.
`at_rest(parameters)` (optional)
    FRICTION_HOLDS if the effect holds positions around a balance, STOP or CONTACT if it pushes
    beyond a limit only: `equilibrium` says so.
`creeping(parameters)` (optional)
    the speed far below which its dry friction is linear, in the unit of the coordinate that it
    acts on, or m/s; None without dry friction. Linear models say so.

The kernel calls them through their addresses: naming another set of effects compiles nothing but
the effects that are new. The arguments are pointers, so nothing is checked and nothing is
allocated. What several effects call (`scalars`, `piecewise`) becomes part of each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.jit import by_address

_numbers, _integers = types.CPointer(types.float64), types.CPointer(types.int64)
FORCE = types.void(
    types.float64, _numbers, _numbers, _numbers, _integers, _numbers, _numbers
)  # t, q, qd, near, slots, params, Q
FRICTION = types.void(
    types.float64, _numbers, _numbers, _numbers, _numbers, _integers, _numbers, _numbers
)  # t, q, qd, near, loads, slots, params, Q
TANGENT = types.void(
    types.float64,
    _numbers,
    _numbers,
    _numbers,
    _numbers,
    _integers,
    _numbers,
    types.int64,
    _numbers,
    _numbers,
)  # t, q, qd, near, loads, slots, params, n, stiff, G
POTENTIAL = types.float64(types.float64, _numbers, _numbers, _integers, _numbers)
SIDE = types.float64(
    types.float64, _numbers, _numbers, _numbers, _integers, _numbers
)  # t, q, qd, near, slots, params
INTERVAL = types.void(
    types.float64, _numbers, _numbers, _numbers, _integers, _numbers, types.int64, _numbers
)  # t, q, qd, near, slots, params, n, out


@dataclass(frozen=True)
class Effect:
    """An effect as a scene names it: `kind` is its file, `name` the instance."""

    kind: str
    name: str
    parameters: Any

    def __reduce__(self) -> tuple[Any, ...]:
        """Its numbers, and what its file is: another process has not run that."""
        from alf_ros import effects

        values = {
            each.name: getattr(self.parameters, each.name) for each in fields(self.parameters)
        }
        return effects.arrived, (self.kind, self.name, values, *effects.carried(self.kind))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The joint coordinates it acts on."""
        found: list[str] = []
        for each in fields(self.parameters):
            kind, value = each.metadata.get('kind'), getattr(self.parameters, each.name)
            if kind == 'coordinate' and value is not None:
                found.append(value)
            elif kind == 'factors':
                found += (name for name, _ in value or ())
        return tuple(found)

    def target(self, coordinates: Collection[str]) -> str | None:
        """The name that targets for it have, on a mechanism with these joint coordinates: of its
        own, or else its name. None if a coordinate has that: targets of the name are of it."""
        joint: str | None = getattr(self.parameters, 'joint', None)
        if joint is not None:
            return joint
        return None if self.name in coordinates else self.name

    @property
    def label(self) -> str:
        """Name that distinguishes it from all other effects of a scene."""
        kind = Path(self.kind.partition('#')[0]).stem
        return self.name if self.name.startswith(kind) else f'{kind}.{self.name}'


@dataclass(frozen=True)
class Packed:
    """Data of the compiled functions of an effect: `slots` are indices, `params` numbers.

    directions: the blocks that each direction of `tangent` moves; intervals: how many scalars
    `interval` knows; instants: of kinks over time (s), at which steps end; smooth:
    whether `side` is the same everywhere, so that nobody needs to ask.
    """

    slots: Integers
    params: Floats
    directions: tuple[tuple[int, ...], ...] = ()
    intervals: int = 0
    instants: Floats = field(default_factory=lambda: np.zeros(0))
    smooth: bool = False


def force(function: Callable[..., None]) -> Any:
    """Compile `force(t, q, qd, near, slots, params, Q)`."""
    return by_address(FORCE)(function)


def potential(function: Callable[..., float]) -> Any:
    """Compile `potential(t, q, near, slots, params)`."""
    return by_address(POTENTIAL)(function)


def friction(function: Callable[..., None]) -> Any:
    """Compile `friction(t, q, qd, near, loads, slots, params, Q)`."""
    return by_address(FRICTION)(function)


WRENCH, EFFORT, EFFORT_OVER_TIME = 'wrench', 'effort', 'effort over time'
FRICTION_HOLDS, STOP, CONTACT = 'friction', 'a stop', 'a contact'


class OnDemand:
    """A function of an effect, compiled when somebody asks for its address."""

    def __init__(self, signature: Any, function: Callable[..., Any]) -> None:
        self.signature, self.function = signature, function

    @cached_property
    def _compiled(self) -> Any:
        return by_address(self.signature)(self.function)

    @property
    def address(self) -> int:
        """Of the compiled function."""
        return int(self._compiled.address)


def tangent(function: Callable[..., None]) -> OnDemand:
    """Compile `tangent(t, q, qd, near, loads, slots, params, n, stiff, G)` when asked for it."""
    return OnDemand(TANGENT, function)


def side(function: Callable[..., float]) -> OnDemand:
    """Compile `side(t, q, qd, near, slots, params)` when asked for it."""
    return OnDemand(SIDE, function)


def interval(function: Callable[..., None]) -> OnDemand:
    """Compile `interval(t, q, qd, near, slots, params, n, out)` when asked for it."""
    return OnDemand(INTERVAL, function)


def not_negative(parameters: Any, *names: str) -> None:
    """Raise ValueError if a parameter is less than zero; one that is not given is not."""
    for name in names:
        value = getattr(parameters, name)
        if value is not None and not value >= 0.0:
            raise ValueError(f'{name} must not be negative')


def positive(parameters: Any, *names: str) -> None:
    """Raise ValueError unless parameters are greater than zero, or not given."""
    for name in names:
        value = getattr(parameters, name)
        if value is not None and not value > 0.0:
            raise ValueError(f'{name} must be greater than zero')


def either(parameters: Any, *names: str) -> None:
    """Raise ValueError unless one of the parameters is given, and only one."""
    if sum(getattr(parameters, name) is not None for name in names) != 1:
        raise ValueError(f'give one of {", ".join(names)}')

"""Inputs as forces: an effect for each, packed, and places for inputs that are zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Floats
from alf_ros.effects.contract import EFFORT, EFFORT_OVER_TIME, WRENCH, Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.kernel import Effects
from alf_ros.mechanism import Coordinate
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.compile import Model
from alf_ros.simulation.input_values import Inputs, Wrench
from alf_ros.simulation.packed_effects import PackedKind, listed, once


class HeldEffect:
    """An effect from outside, packed once for each layout that asks, whatever else is held."""

    def __init__(self, what: Wrench | float | Curve, effect: Effect) -> None:
        self.what, self._effect = what, effect
        self._kinds: list[tuple[Layout, list[PackedKind]]] = []

    def __reduce__(self) -> tuple[Any, ...]:
        """Without the addresses of compiled code, which belong to this process."""
        return HeldEffect, (self.what, self._effect)

    def kinds(self, layout: Layout) -> list[PackedKind]:
        """The effect, as compiled code takes it."""
        return once(self._kinds, (self._effect,), layout)

    def instants(self, layout: Layout) -> list[Floats]:
        """The times of its kinks over time, s."""
        return [kind.packed.instants for kind in self.kinds(layout) if kind.packed.instants.size]


class Multiple:
    """The data of 1 times a number: of a steady effort, which is packed once however often it
    changes, or of a place."""

    def __init__(self, what: float, one: HeldEffect) -> None:
        self.what, self.one = what, one

    def kinds(self, layout: Layout) -> list[PackedKind]:
        """The effect, as compiled code takes it."""
        each = zip(self.one.kinds(layout), self.params(layout), strict=True)
        return [replace(kind, packed=replace(kind.packed, params=params)) for kind, params in each]

    def params(self, layout: Layout) -> list[Floats]:
        """The numbers of its kinds."""
        with np.errstate(over='ignore'):  # a step with it fails, and says so
            return [self.what * kind.packed.params for kind in self.one.kinds(layout)]

    def instants(self, layout: Layout) -> list[Floats]:
        """The times of its kinks over time, s."""
        return self.one.instants(layout)


Held: TypeAlias = HeldEffect | Multiple


class InputPlace(NamedTuple):
    """A place among the forces, without a force: data of an input that is zero. slope: of the data
    by the input, in the layout of the run."""

    held: Held
    slope: Floats


def held_input(
    model: Model,
    name: str,
    what: Wrench | float | Curve,
    before: Held | None = None,
) -> Held:
    """The held command on a body, point or joint, as an effect; `before`: the command there
    until now."""
    if before is not None and before.what == what:
        return before
    if isinstance(what, Wrench):
        return HeldEffect(what, registry.held(WRENCH, name, what))
    coordinate = model.coordinates[model.coordinate_names.index(name)]
    role = EFFORT_OVER_TIME if isinstance(what, Curve) else _steady(coordinate)
    if role != EFFORT or isinstance(what, Curve):
        return HeldEffect(what, registry.held(role, name, what))
    one = before.one if isinstance(before, Multiple) else None
    return Multiple(what, one or HeldEffect(1.0, registry.held(EFFORT, name, 1.0)))


def place_of(model: Model, one: Inputs) -> InputPlace:
    """The place of an input; one: a single wrench or effort, which is 1."""
    name, what = next(item for of in (one.wrenches, one.efforts) for item in of.items())
    own, layout = held_input(model, name, what), model.layout
    slope = _data(own, layout)
    if isinstance(own, Multiple):
        return InputPlace(Multiple(0.0, own.one), slope)
    if isinstance(what, Wrench):
        return InputPlace(Multiple(0.0, own), slope)
    none = held_input(model, name, 0.0)
    data = _data(none, layout)
    with np.errstate(invalid='ignore'):  # no limit is an infinite one
        return InputPlace(none, np.where(slope == data, 0.0, slope - data))


def _data(of: Held, layout: Layout) -> Floats:
    return np.concatenate([kind.packed.params for kind in of.kinds(layout)])


def one_by_one(model: Model, each: Sequence[Inputs]) -> Effects:
    """Inputs of a single wrench or effort, packed as an effect each, in their order."""
    items = (
        item for inputs in each for item in (*inputs.wrenches.items(), *inputs.efforts.items())
    )
    kinds = [held_input(model, name, what).kinds(model.layout) for name, what in items]
    return listed([kind for group in kinds for kind in group])


def from_outside(model: Model) -> set[str]:
    """The effects that wrenches and steady efforts on this mechanism are packed as."""
    roles = {WRENCH, *(_steady(each) for each in model.coordinates)}
    return {registry.ROLES[role] for role in roles}


def _steady(coordinate: Coordinate) -> str:
    """The role that packs a steady effort."""
    return EFFORT if coordinate.freedom.alone else EFFORT_OVER_TIME

"""Forces on the mechanism in a run: the scene's effects and the inputs held, packed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Floats
from alf_ros.effects.contract import Effect
from alf_ros.kernel import Axes, Bearings, Effects, Forces, Ledger
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.compile import Model
from alf_ros.model.effect_directions import Direction
from alf_ros.model.struct_memory import changed
from alf_ros.simulation.held_inputs import Held, InputPlace, Multiple, held_input
from alf_ros.simulation.input_values import Inputs, Target
from alf_ros.simulation.joint_efforts import axes_of
from alf_ros.simulation.kink_search import kinks, kinks_of_drives
from alf_ros.simulation.packed_effects import (
    NOTHING,
    AskedFunctions,
    PackedKind,
    kinds_of,
    listed,
    loaded,
    once,
)
from alf_ros.simulation.reaction_friction import bearings
from alf_ros.simulation.reactions import Reactions
from alf_ros.simulation.work_ledger import INPUTS, ledger


class Part(NamedTuple):
    """A part of the effects, packed, and the indices of their loads (`Applied.loads`)."""

    effects: Effects
    loads: list[int]


class OnAxes(NamedTuple):
    """Efforts on free axes of joints, axis after axis."""

    axes: Axes
    part: Part


class _Scene:
    """The effects of a scene, packed once for each layout that asks, whatever is held."""

    def __init__(
        self,
        model: Model,
        effects: Sequence[Effect],
        reactions: Callable[[], Reactions],
        asked: AskedFunctions,
    ) -> None:
        self.effects = tuple(effects)
        self._model, self.reactions, self._asked = model, reactions, asked
        self._kinds: list[tuple[Layout, list[PackedKind]]] = []
        self._on_axes: OnAxes | None = None

    def kinds(self, layout: Layout) -> list[PackedKind]:
        return once(self._kinds, self.effects, layout, self._asked)

    @property
    def directions(self) -> list[Direction]:
        """In which the effects yield."""
        return [
            Direction(e, n, blocks)
            for e, kind in enumerate(self.kinds(self._model.layout))
            if kind.tangent
            for n, blocks in enumerate(kind.packed.directions)
        ]

    @cached_property
    def _rubbing(self) -> list[Effect]:
        """The effect that each load is for."""
        return [each for kind in self.kinds(self._model.layout) for each in kind.rubbing]

    @cached_property
    def loading(self) -> dict[str, str]:
        joints = {each.name: each.joint.name for each in self._model.coordinates}
        pairs = ((effect.label, loaded(effect)) for effect in self._rubbing)
        return {label: joints[name] for label, name in pairs if name is not None}

    @property
    def load_count(self) -> int:
        count = len(self._rubbing) * self._model.layout.dimension
        return count + 1 if count else 0

    @cached_property
    def bearings(self) -> Bearings:
        """The data that give the loads, without the forces on the cut mechanism."""
        joints = {each.name: each.joint for each in self._model.coordinates}
        names = [loaded(effect) for effect in self._rubbing]
        return bearings(self.reactions, [None if n is None else joints[n] for n in names])

    @cached_property
    def instants(self) -> Floats:
        """Of the kinks over time of effects and drives, s, ascending."""
        layout = self._model.layout
        every = [kind.packed.instants for kind in self.kinds(layout)]
        return np.unique(np.concatenate([*every, kinks_of_drives(layout.mechanism)]))

    @cached_property
    def each(self) -> dict[str, Part]:
        layout = self._model.layout
        return {effect.label: self._part(layout, [effect]) for effect in self.effects}

    @cached_property
    def acts_on_axes(self) -> bool:
        return any(effect.coordinates for effect in self.effects)

    def on_axes(self, cut: Layout) -> OnAxes:
        if self._on_axes is None:
            groups: dict[str, list[Effect]] = {}
            for effect in self.effects:
                for joint in effect.coordinates:
                    groups.setdefault(joint, []).append(_on_axis(effect, joint))
            kinds = {joint: kinds_of(group, cut) for joint, group in groups.items()}
            counts = {joint: len(each) for joint, each in kinds.items()}
            self._on_axes = OnAxes(
                axes_of(self._model.coordinates, counts, cut),
                self._loaded_part([kind for each in kinds.values() for kind in each]),
            )
        return self._on_axes

    def _part(self, layout: Layout, effects: Sequence[Effect]) -> Part:
        return self._loaded_part(kinds_of(effects, layout))

    def _loaded_part(self, kinds: Sequence[PackedKind]) -> Part:
        rubbing = [each for kind in kinds for each in kind.rubbing]
        return Part(listed(kinds), [self._rubbing.index(each) for each in rubbing])


def _on_axis(effect: Effect, joint: str) -> Effect:
    """The part of an effect that acts on one joint coordinate."""
    part = getattr(registry.load(effect.kind), 'on_axis', None)
    return effect if part is None else replace(effect, parameters=part(effect.parameters, joint))


class Applied:
    """Effects and inputs, packed once for each layout that asks. It never changes."""

    def __init__(
        self,
        model: Model,
        effects: Sequence[Effect],
        inputs: Inputs,
        reactions: Callable[[], Reactions],
        weights: Floats | None = None,
        asked: AskedFunctions = NOTHING,
        before: Applied | None = None,
        places: Sequence[InputPlace] = (),
    ) -> None:
        """`before`, of the same effects: what it packed and still holds is used again. `weights`
        (stages,) of the method: a ledger is kept. places: behind all that is held.

        Raises InputError if an effect does not fit the mechanism.
        """
        self.inputs = inputs
        self._model, self._given, self._reactions = model, effects, reactions
        self._places = tuple(places)
        self._weights, self._asked = weights, asked
        self._scene: _Scene
        if before is not None and before.inputs.targets == inputs.targets:
            self._scene = before._scene
        else:
            names = model.coordinate_names
            aimed = [_aimed(each, inputs.targets, names) for each in effects]
            self._scene = _Scene(model, aimed, reactions, asked)
        self._elsewhere: tuple[Layout, Effects] | None = None
        known = before._held if before is not None else {}
        wanted = {('wrench', name): wrench for name, wrench in inputs.wrenches.items()}
        wanted |= {('added', name): wrench for name, wrench in inputs.added.items()}
        efforts = {('effort', joint): effort for joint, effort in inputs.efforts.items()}
        self._held: dict[tuple[str, str], Held] = {}
        self._known: tuple[Forces, Mapping[tuple[str, str], Held]] | None = None
        if before is not None and before._scene is self._scene:
            assembled = vars(before).get('assembled')
            self._known = before._known if assembled is None else (assembled, before._held)
        for key, what in {**wanted, **efforts}.items():
            self._held[key] = held_input(model, key[1], what, known.get(key))
        self._held.update((('place', str(n)), each.held) for n, each in enumerate(places))

    def __reduce__(self) -> tuple[Any, ...]:
        """State without the addresses of compiled code, which belong to this process."""
        given = self._given, self.inputs, self._reactions, self._weights, self._asked
        return Applied, (self._model, *given, None, self._places)

    def holding(self, inputs: Inputs, places: Sequence[InputPlace] = ()) -> Applied:
        """The same effects with other inputs."""
        given = self._reactions, self._weights, self._asked
        return Applied(self._model, self._given, inputs, *given, self, places)

    @property
    def directions(self) -> list[Direction]:
        """In which the effects of the scene yield, for an implicit method."""
        return self._scene.directions

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects of the scene, as they act."""
        return self._scene.effects

    @cached_property
    def assembled(self) -> Forces:
        """For the step: bodies share their points."""
        again, self._known = self._with_efforts(), None
        if again is not None:
            return again
        rub = self._scene.bearings
        if rub.settle.size:
            rub = replace(rub, effects=self.on(self._reactions().cut))
        layout = self._model.layout
        scalars = [(kind.interval, kind.packed.intervals) for kind in self._all(layout)]
        found = kinks(self._model, scalars, self.instants, not self._asked.ends)
        return Forces(self._pack(layout), rub, self._ledger, found)

    def _with_efforts(self) -> Forces | None:
        """The forces that were assembled before, with other efforts; None if more has changed, or
        the forces are needed elsewhere too."""
        if self._known is None or self._weights is not None or self._scene.bearings.settle.size:
            return None
        forces, held = self._known
        if list(held) != list(self._held):
            return None
        layout, effects = self._model.layout, forces.effects
        params, first = effects.params.copy(), len(self._scene.kinds(layout))
        for n, (was, now) in enumerate(zip(held.values(), self._held.values(), strict=True)):
            if now is was:
                continue
            if not isinstance(now, Multiple) or not isinstance(was, Multiple):
                return None
            (numbers,), at = now.params(layout), int(effects.params_at[first + n])
            params[at : at + numbers.size] = numbers
        return changed(forces, effects=changed(effects, params=params))

    @cached_property
    def instants(self) -> Floats:
        """The times of all kinks over time, s, ascending."""
        layout, own = self._model.layout, self._scene.instants
        more = [each for held in self._held.values() for each in held.instants(layout)]
        return np.unique(np.concatenate([own, *more])) if more else own

    @property
    def _ledger(self) -> Ledger:
        if self._weights is None:
            return _no_ledger()
        layout = self._model.layout
        parts = list(self.each.items())
        parts += [(INPUTS, Part(listed(held.kinds(layout)), [])) for held in self._held.values()]
        return ledger(self._model, self._weights, parts)

    @property
    def load_count(self) -> int:
        """How many numbers the loads are: R of each effect of a kind that rubs, and the sense of
        their balance."""
        return self._scene.load_count

    @property
    def loads(self) -> Floats:
        """N, of each effect with friction, from the last solve for accelerations."""
        return self._scene.bearings.loads.copy()

    @property
    def loading(self) -> dict[str, str]:
        """By label, the joint whose reaction is the load of an effect."""
        return self._scene.loading

    @property
    def each(self) -> dict[str, Part]:
        """The effects of the scene, one by one."""
        return self._scene.each

    def on(self, layout: Layout) -> Effects:
        """All forces for another layout: the layout of the reactions, with each body alone."""
        if self._elsewhere is None or self._elsewhere[0] is not layout:
            self._elsewhere = layout, self._pack(layout)
        return self._elsewhere[1]

    @property
    def acts_on_axes(self) -> bool:
        """Whether an effect of the scene acts on a joint coordinate."""
        return self._scene.acts_on_axes

    def on_axes(self, cut: Layout) -> OnAxes:
        """For the cut layout, what the effects of the scene exert on joint coordinates."""
        return self._scene.on_axes(cut)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The files of the effects that the kernel calls, in its order."""
        return tuple(kind.name for kind in self._all(self._model.layout))

    @cached_property
    def is_steady(self) -> bool:
        """Whether the forces depend neither on time nor on the motion."""
        return all(getattr(registry.load(kind), 'CONSTANT', False) for kind in self.kinds)

    def _all(self, layout: Layout) -> list[PackedKind]:
        kinds = list(self._scene.kinds(layout))
        for held in self._held.values():
            kinds += held.kinds(layout)
        return kinds

    def _pack(self, layout: Layout) -> Effects:
        return listed(self._all(layout))


@cache
def _no_ledger() -> Ledger:
    return Ledger.empty()


def _aimed(effect: Effect, targets: Mapping[str, Target], coordinates: Sequence[str]) -> Effect:
    """The effect, with its target if it follows one."""
    if not targets:
        return effect
    module, name = registry.load(effect.kind), effect.target(coordinates)
    if name is None or not hasattr(module, 'aimed') or name not in targets:
        return effect
    target = targets[name]
    aimed = module.aimed(effect.parameters, target.position, target.velocity)
    return replace(effect, parameters=aimed)

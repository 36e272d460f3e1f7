"""What acts on the mechanism in a run: the scene's effects and the inputs held, packed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.bearings import bearings
from alf_ros.effects.contract import Effect
from alf_ros.errors import InputError
from alf_ros.kernel import Effects, Forces
from alf_ros.layout import Layout
from alf_ros.mechanism import GROUND
from alf_ros.model import Model
from alf_ros.reactions import Reactions


@dataclass(frozen=True)
class Wrench:
    """A force (N) and a torque (N m; in the plane about +z), held on a body or point.

    `at` names a point of the body (default: its centre of mass); `frame` is 'world' or 'body'.
    """

    force: tuple[float, ...]
    torque: float | tuple[float, ...] = 0.0
    at: str | None = None
    frame: str = 'world'


@dataclass(frozen=True)
class Inputs:
    """All that is held from outside: wrenches by body or point, efforts (N m or N) by joint."""

    wrenches: Mapping[str, Wrench]
    efforts: Mapping[str, float]


NO_INPUTS = Inputs({}, {})


class Part(NamedTuple):
    """Some of what acts, packed: effects, and which of all loads (`Applied.loads`) are theirs."""

    effects: Effects
    loads: list[int]


class Applied:
    """Effects and inputs, packed once for each layout that asks. It never changes."""

    def __init__(
        self,
        model: Model,
        effects: Sequence[Effect],
        inputs: Inputs,
        reactions: Callable[[], Reactions],
    ) -> None:
        """Raises InputError if an effect does not fit the mechanism."""
        self.inputs = inputs
        self._model, self._reactions = model, reactions
        self.effects = tuple(effects)
        self._from_outside = [*_wrench_effects(inputs), *_effort_effects(inputs)]
        self._elsewhere: tuple[Layout, Effects] | None = None
        self._on_joints: dict[str, Part] | None = None

    @cached_property
    def assembled(self) -> Forces:
        """For the step: bodies share their points."""
        joints = {each.name: each.joint for each in self._model.coordinates}
        loaded = [_loaded(effect) for effect in self._rubbing]
        return Forces(
            effects=self._pack(self._model.layout, self.effects, self._from_outside),
            bearings=bearings(
                self._reactions,
                [None if name is None else joints[name] for name in loaded],
                lambda: self.on(self._reactions().cut),
            ),
        )

    @cached_property
    def _rubbing(self) -> list[Effect]:
        """The effect that each load is for."""
        return _with_loads(self.effects)

    @property
    def loads(self) -> Floats:
        """N, of each effect with friction: what was found by the last solve for accelerations."""
        return self.assembled.bearings.loads.copy()

    @cached_property
    def each(self) -> dict[str, Part]:
        """The effects of the scene, one by one."""
        layout = self._model.layout
        return {effect.label: self._part(layout, [effect]) for effect in self.effects}

    def on(self, layout: Layout) -> Effects:
        """All of it for another layout: that of the reactions, with each body alone."""
        if self._elsewhere is None or self._elsewhere[0] is not layout:
            self._elsewhere = layout, self._pack(layout, self.effects, self._from_outside)
        return self._elsewhere[1]

    def on_joints(self, layout: Layout) -> dict[str, Part]:
        """For another layout, what the effects of the scene exert on each joint coordinate."""
        if self._on_joints is None:
            groups: dict[str, list[Effect]] = {}
            for effect in self.effects:
                for joint in effect.coordinates:
                    groups.setdefault(joint, []).append(effect)
            self._on_joints = {joint: self._part(layout, group) for joint, group in groups.items()}
        return self._on_joints

    def _part(self, layout: Layout, effects: Sequence[Effect]) -> Part:
        loads = [self._rubbing.index(effect) for effect in _with_loads(effects)]
        return Part(self._pack(layout, effects, ()), loads if self.loads.size else [])

    def _pack(
        self, layout: Layout, effects: Sequence[Effect], from_outside: Sequence[Effect]
    ) -> Effects:
        groups = [(kind, True, of_kind) for kind, of_kind in _by_kind(effects)]
        groups += [(kind, False, of_kind) for kind, of_kind in _by_kind(from_outside)]
        addresses: dict[str, list[int]] = {'force': [], 'potential': [], 'friction': []}
        slots: list[Integers] = []
        params: list[Floats] = []
        loads_at: list[int] = []
        loads = 0
        for kind, may_rub, instances in groups:
            module = registry.load(kind)
            try:
                packed = module.pack(instances, layout)
            except ValueError as error:
                names = ', '.join(effect.name for effect in instances)
                raise InputError(str(error), key=f'{kind} ({names})') from None
            rubs = may_rub and any(map(_loaded, instances))
            for name, found in addresses.items():
                used = hasattr(module, name) and (name != 'friction' or rubs)
                found.append(getattr(module, name).address if used else 0)
            slots.append(packed.slots)
            params.append(packed.params)
            loads_at.append(loads)
            loads += len(instances) if rubs else 0
        return Effects(
            **{name: np.array(found, dtype=np.uint64) for name, found in addresses.items()},
            slots=np.concatenate([np.zeros(0, dtype=np.int64), *slots]),
            params=np.concatenate([np.zeros(0), *params]),
            slots_at=_starts(slots),
            params_at=_starts(params),
            loads_at=np.array(loads_at, dtype=np.uint64),
        )


def _by_kind(effects: Sequence[Effect]) -> list[tuple[str, list[Effect]]]:
    """As they are packed: all of a kind together."""
    kinds: dict[str, list[Effect]] = {}
    for effect in effects:
        kinds.setdefault(effect.kind, []).append(effect)
    return list(kinds.items())


def _with_loads(effects: Sequence[Effect]) -> list[Effect]:
    """All instances of the kinds of which one at least depends on a reaction, as packed."""
    kinds = (of_kind for _, of_kind in _by_kind(effects) if any(map(_loaded, of_kind)))
    return [effect for of_kind in kinds for effect in of_kind]


def _loaded(effect: Effect) -> str | None:
    """The joint coordinate whose reaction an effect depends on."""
    module = registry.load(effect.kind)
    if not hasattr(module, 'loaded'):
        return None
    name: str | None = module.loaded(effect.parameters)
    return name


def _starts(parts: Sequence[Floats] | Sequence[Integers]) -> Addresses:
    sizes = [part.size for part in parts]
    return np.cumsum([0, *sizes], dtype=np.uint64)[:-1]


def _wrench_effects(inputs: Inputs) -> list[Effect]:
    if not inputs.wrenches:
        return []
    constant_wrench = registry.load('constant_wrench')
    return [
        Effect(
            'constant_wrench',
            name,
            constant_wrench.Parameters(name, wrench.force, wrench.torque, wrench.at, wrench.frame),
        )
        for name, wrench in inputs.wrenches.items()
    ]


def _effort_effects(inputs: Inputs) -> list[Effect]:
    if not inputs.efforts:
        return []
    joint_effort = registry.load('joint_effort')
    return [
        Effect('joint_effort', name, joint_effort.Parameters(name, effort))
        for name, effort in inputs.efforts.items()
    ]


def checked_wrench(model: Model, name: str, wrench: Wrench) -> Wrench:
    """The wrench, if it can act on that body or point. Raises InputError otherwise."""
    layout = model.layout
    choices = [*model.body_names, *(p.name for p in model.mechanism.points if not p.fixed)]
    if name not in choices:
        raise InputError('unknown body or point', key='wrench', value=name, choices=choices)
    D = layout.dimension
    torque = wrench.torque if isinstance(wrench.torque, tuple) else (wrench.torque,)
    numbers = [*wrench.force, *torque]
    sizes = (D, 1 if D == 2 else 3)
    torque_fits = len(torque) == sizes[1] or not any(torque)
    if len(wrench.force) != D or not torque_fits or not all(map(math.isfinite, numbers)):
        expected = 'a finite torque' if D == 2 else '3 finite torques'
        message = f'{D} finite forces and {expected}'
        raise InputError('not a wrench', key=name, value=numbers, expected=message)
    if wrench.frame not in ('world', 'body'):
        raise InputError('unknown frame', key=name, value=wrench.frame, choices=('world', 'body'))
    if not layout.turns(name) and (any(torque) or wrench.frame == 'body'):
        raise InputError('has no orientation: no torque on it, and no frame of its own', key=name)
    if wrench.at is not None:
        points = layout.body[name].points if name in layout.body else ()
        if wrench.at not in points:
            raise InputError('not a point of this body', key=name, value=wrench.at, choices=points)
    return wrench


def checked_effort(model: Model, joint: str, effort: float) -> float:
    """The effort, if that joint coordinate can take one. Raises InputError otherwise."""
    names = model.coordinate_names
    if joint not in names:
        raise InputError('unknown joint', key='effort', value=joint, choices=names)
    if not math.isfinite(effort):
        raise InputError('not an effort', key=joint, value=effort, expected='a finite number')
    coordinate = model.coordinates[names.index(joint)]
    if coordinate.joint.kind == 'universal':
        raise InputError('has two free axes: no effort on them', key=joint)
    for name in (coordinate.joint.child, coordinate.joint.parent):
        if coordinate.is_angle and name != GROUND and not model.layout.turns(name):
            raise InputError(f'{name!r} has no orientation: no torque on it', key=joint)
    return float(effort)

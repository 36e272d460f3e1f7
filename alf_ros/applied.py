"""What acts on the mechanism in a run: the scene's effects and the inputs held, packed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.curve import Curve
from alf_ros.effects.contract import Effect, Packed
from alf_ros.errors import InputError
from alf_ros.kernel import Forces
from alf_ros.layout import Layout
from alf_ros.model import Model

# The effects that inputs are packed as.
FROM_OUTSIDE = ('constant_wrench', 'joint_effort', 'motor')


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
class Target:
    """What the motor on a joint is to follow, in place of what the scene says: x* (rad or m), and
    ẋ* (rad/s or m/s) if not the slope of x*."""

    position: float | Curve | None = None
    velocity: float | None = None


@dataclass(frozen=True)
class Inputs:
    """All that is held from outside: wrenches by body or point, efforts (N m or N) and targets of
    motors by joint."""

    wrenches: Mapping[str, Wrench]
    efforts: Mapping[str, float | Curve]
    targets: Mapping[str, Target] = field(default_factory=dict)


NO_INPUTS = Inputs({}, {})


@dataclass(frozen=True)
class _Part:
    """An effect's functions (addresses; 0: no potential), and its instances packed."""

    force: int
    potential: int
    packed: Packed


class _Held:
    """An effect from outside, packed once for each layout that asks, whatever else is held."""

    def __init__(self, what: Wrench | float | Curve, effect: Effect) -> None:
        self.what = what
        self._effect = effect
        self._parts: list[tuple[Layout, list[_Part]]] = []

    def parts(self, layout: Layout) -> list[_Part]:
        return _once(self._parts, (self._effect,), layout)


class _Scene:
    """The effects of a scene, packed once for each layout that asks, whatever is held."""

    def __init__(self, model: Model, effects: Sequence[Effect]) -> None:
        self.effects = tuple(effects)
        self._model = model
        self._parts: list[tuple[Layout, list[_Part]]] = []
        self._on_joints: dict[str, Forces] | None = None

    def parts(self, layout: Layout) -> list[_Part]:
        return _once(self._parts, self.effects, layout)

    @cached_property
    def each(self) -> dict[str, Forces]:
        one_by_one = (Applied(self._model, [effect], NO_INPUTS) for effect in self.effects)
        labels = (effect.label for effect in self.effects)
        return {label: one.assembled for label, one in zip(labels, one_by_one, strict=True)}

    def on_joints(self, layout: Layout) -> dict[str, Forces]:
        if self._on_joints is None:
            groups: dict[str, list[Effect]] = {}
            for effect in self.effects:
                for joint in effect.coordinates:
                    groups.setdefault(joint, []).append(effect)
            self._on_joints = {
                joint: Applied(self._model, group, NO_INPUTS).on(layout)
                for joint, group in groups.items()
            }
        return self._on_joints


class Applied:
    """Effects and inputs, packed once for each layout that asks. It never changes."""

    def __init__(
        self,
        model: Model,
        effects: Sequence[Effect],
        inputs: Inputs,
        before: Applied | None = None,
    ) -> None:
        """`before`, of the same effects: what it packed and still holds is used again.

        Raises InputError if an effect does not fit the mechanism.
        """
        self.inputs = inputs
        self._model, self._given = model, effects
        self._scene: _Scene
        if before is not None and before.inputs.targets == inputs.targets:
            self._scene = before._scene
        else:
            self._scene = _Scene(model, [_aimed(each, inputs.targets) for each in effects])
        self._elsewhere: tuple[Layout, Forces] | None = None
        known = before._held if before is not None else {}
        wanted = {('wrench', name): wrench for name, wrench in inputs.wrenches.items()}
        efforts = {('effort', joint): effort for joint, effort in inputs.efforts.items()}
        self._held: dict[tuple[str, str], _Held] = {
            key: known[key] if key in known and known[key].what == what else _held(key[1], what)
            for key, what in {**wanted, **efforts}.items()
        }

    def holding(self, inputs: Inputs) -> Applied:
        """The same effects with other inputs."""
        return Applied(self._model, self._given, inputs, self)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects of the scene, as they act."""
        return self._scene.effects

    @cached_property
    def assembled(self) -> Forces:
        """For the step: bodies share their points."""
        return self._pack(self._model.layout)

    @property
    def each(self) -> dict[str, Forces]:
        """The effects of the scene, one by one."""
        return self._scene.each

    def on(self, layout: Layout) -> Forces:
        """For another layout: that of the reactions, with each body alone."""
        if self._elsewhere is None or self._elsewhere[0] is not layout:
            self._elsewhere = layout, self._pack(layout)
        return self._elsewhere[1]

    def on_joints(self, layout: Layout) -> dict[str, Forces]:
        """For another layout, what the effects of the scene exert on each joint coordinate."""
        return self._scene.on_joints(layout)

    def _pack(self, layout: Layout) -> Forces:
        parts = list(self._scene.parts(layout))
        for held in self._held.values():
            parts += held.parts(layout)
        slots = [part.packed.slots for part in parts]
        params = [part.packed.params for part in parts]
        return Forces(
            force=np.array([part.force for part in parts], dtype=np.uint64),
            potential=np.array([part.potential for part in parts], dtype=np.uint64),
            slots=np.concatenate([np.zeros(0, dtype=np.int64), *slots]),
            params=np.concatenate([np.zeros(0), *params]),
            slots_at=_starts(slots),
            params_at=_starts(params),
        )


def _once(
    packed: list[tuple[Layout, list[_Part]]], effects: Sequence[Effect], layout: Layout
) -> list[_Part]:
    """The parts of effects on a layout, kept in `packed`: two layouts, or three, ever ask."""
    for known, parts in packed:
        if known is layout:
            return parts
    packed.append((layout, _parts(effects, layout)))
    return packed[-1][1]


def _parts(effects: Sequence[Effect], layout: Layout) -> list[_Part]:
    """One for each kind. Raises InputError if an effect does not fit the mechanism."""
    kinds: dict[str, list[Effect]] = {}
    for effect in effects:
        kinds.setdefault(effect.kind, []).append(effect)
    parts = []
    for kind, instances in kinds.items():
        module = registry.load(kind)
        try:
            packed = module.pack(instances, layout)
        except ValueError as error:
            names = ', '.join(effect.name for effect in instances)
            raise InputError(str(error), key=f'{kind} ({names})') from None
        potential = module.potential.address if hasattr(module, 'potential') else 0
        parts.append(_Part(module.force.address, potential, packed))
    return parts


def _starts(parts: Sequence[Floats] | Sequence[Integers]) -> Addresses:
    sizes = [part.size for part in parts]
    return np.cumsum([0, *sizes], dtype=np.uint64)[:-1]


def _held(name: str, what: Wrench | float | Curve) -> _Held:
    """What is held on a body, point or joint, as an effect; an effort over time is a motor without
    a controller."""
    kind = 'motor' if isinstance(what, Curve) else 'joint_effort'
    if isinstance(what, Wrench):
        kind, given = 'constant_wrench', (name, what.force, what.torque, what.at, what.frame)
        return _Held(what, Effect(kind, name, registry.load(kind).Parameters(*given)))
    return _Held(what, Effect(kind, name, registry.load(kind).Parameters(joint=name, effort=what)))


def _aimed(effect: Effect, targets: Mapping[str, Target]) -> Effect:
    """The effect, with its target if it is a motor that has one."""
    if effect.kind != 'motor' or effect.parameters.joint not in targets:
        return effect
    target, given = targets[effect.parameters.joint], effect.parameters
    if target.position is not None and given.position_gain:
        given = replace(given, position=target.position, velocity=target.velocity)
    elif target.velocity is not None and given.velocity_gain:
        given = replace(given, velocity=target.velocity)
    return replace(effect, parameters=given)

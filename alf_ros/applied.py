"""What acts on the mechanism in a run: the scene's effects and the inputs held, packed."""

from __future__ import annotations

import math
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
from alf_ros.mechanism import GROUND
from alf_ros.model import Model


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


class _Scene:
    """The effects of a scene, packed once for each layout that asks, whatever is held."""

    def __init__(self, model: Model, effects: Sequence[Effect]) -> None:
        self.effects = tuple(effects)
        self._model = model
        self._parts: list[tuple[Layout, list[_Part]]] = []
        self._on_joints: dict[str, Forces] | None = None

    def parts(self, layout: Layout) -> list[_Part]:
        for known, parts in self._parts:
            if known is layout:
                return parts
        self._parts.append((layout, _parts(self.effects, layout)))
        return self._parts[-1][1]

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
        self._from_outside = [*_wrench_effects(inputs), *_effort_effects(inputs)]

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
        parts = [*self._scene.parts(layout), *_parts(self._from_outside, layout)]
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
    """Constant efforts, and those over time as motors without a controller."""
    return [_effort_effect(joint, effort) for joint, effort in inputs.efforts.items()]


def _effort_effect(joint: str, effort: float | Curve) -> Effect:
    kind = 'motor' if isinstance(effort, Curve) else 'joint_effort'
    return Effect(kind, joint, registry.load(kind).Parameters(joint=joint, effort=effort))


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


def follows(effects: Sequence[Effect], joint: str) -> tuple[bool, bool]:
    """Whether a motor on this joint coordinate follows positions, and velocities."""
    motors = [e.parameters for e in effects if e.kind == 'motor' and e.parameters.joint == joint]
    return any(p.position_gain for p in motors), any(p.velocity_gain for p in motors)


def checked_target(model: Model, effects: Sequence[Effect], joint: str, target: Target) -> Target:
    """The target, if a motor on that joint can follow it. Raises InputError otherwise."""
    names = model.coordinate_names
    if joint not in names:
        raise InputError('unknown joint', key='target', value=joint, choices=names)
    for wanted, found, gain in zip(
        (target.position, target.velocity),
        follows(effects, joint),
        ('position_gain', 'velocity_gain'),
        strict=True,
    ):
        if isinstance(wanted, float) and not math.isfinite(wanted):
            raise InputError('not a target', key=joint, value=wanted, expected='a finite number')
        if wanted is not None and not found:
            raise InputError(f'no motor with a {gain} on it', key=joint)
    return target


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


def checked_effort(model: Model, joint: str, effort: float | Curve) -> float | Curve:
    """The effort, if that joint coordinate can take one. Raises InputError otherwise."""
    names = model.coordinate_names
    if joint not in names:
        raise InputError('unknown joint', key='effort', value=joint, choices=names)
    if not isinstance(effort, Curve) and not math.isfinite(effort):
        raise InputError('not an effort', key=joint, value=effort, expected='a finite number')
    coordinate = model.coordinates[names.index(joint)]
    if coordinate.joint.kind == 'universal':
        raise InputError('has two free axes: no effort on them', key=joint)
    for name in (coordinate.joint.child, coordinate.joint.parent):
        if coordinate.is_angle and name != GROUND and not model.layout.turns(name):
            raise InputError(f'{name!r} has no orientation: no torque on it', key=joint)
    return effort if isinstance(effort, Curve) else float(effort)

"""What acts on the mechanism in a run: the scene's effects and the inputs held, packed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.effects.contract import Effect
from alf_ros.errors import InputError
from alf_ros.kernel import Forces
from alf_ros.layout import Layout
from alf_ros.mechanism import GROUND, Joint
from alf_ros.model import Model


@dataclass(frozen=True)
class Wrench:
    """A force (N) and a torque about +z (N m) held on a body or point until replaced.

    `at` names a point of the body (default: its centre of mass); `frame` is 'world' or 'body'.
    """

    force: tuple[float, ...]
    torque: float = 0.0
    at: str | None = None
    frame: str = 'world'


@dataclass(frozen=True)
class Inputs:
    """All that is held from outside: wrenches by body or point, efforts (N m or N) by joint."""

    wrenches: Mapping[str, Wrench]
    efforts: Mapping[str, float]


NO_INPUTS = Inputs({}, {})


class Applied:
    """Effects and inputs, packed once for each layout that asks. It never changes."""

    def __init__(self, model: Model, effects: Sequence[Effect], inputs: Inputs) -> None:
        """Raises InputError if an effect does not fit the mechanism."""
        self.inputs = inputs
        self._model = model
        self._effects = tuple(effects)
        self._from_outside = [*_wrench_effects(inputs), *_effort_effects(model, inputs)]

    @cached_property
    def assembled(self) -> Forces:
        """For the step: bodies share their points."""
        return self._pack(self._model.layout)

    @cached_property
    def cut(self) -> Forces:
        """For the reactions: each body alone."""
        return self._pack(self._model.cut)

    def _pack(self, layout: Layout) -> Forces:
        kinds: dict[tuple[str, bool], list[Effect]] = {}
        for effect in self._effects:
            kinds.setdefault((effect.kind, False), []).append(effect)
        for effect in self._from_outside:
            kinds.setdefault((effect.kind, True), []).append(effect)
        force: list[int] = []
        potential: list[int] = []
        slots: list[Integers] = []
        params: list[Floats] = []
        for (kind, _), instances in kinds.items():
            module = registry.load(kind)
            try:
                packed = module.pack(instances, layout)
            except ValueError as error:
                names = ', '.join(effect.name for effect in instances)
                raise InputError(str(error), key=f'{kind} ({names})') from None
            force.append(module.force.address)
            potential.append(module.potential.address if hasattr(module, 'potential') else 0)
            slots.append(packed.slots)
            params.append(packed.params)
        return Forces(
            force=np.array(force, dtype=np.uint64),
            potential=np.array(potential, dtype=np.uint64),
            slots=np.concatenate([np.zeros(0, dtype=np.int64), *slots]),
            params=np.concatenate([np.zeros(0), *params]),
            slots_at=_starts(slots),
            params_at=_starts(params),
        )


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


def _effort_effects(model: Model, inputs: Inputs) -> list[Effect]:
    """An effort acts on the child and, the other way round, on the parent."""
    if not inputs.efforts:
        return []
    constant_wrench = registry.load('constant_wrench')
    joints = {joint.name: joint for joint in model.mechanism.joints}
    effects = []
    for name, effort in inputs.efforts.items():
        joint: Joint = joints[name]
        if joint.kind == 'slider' and joint.direction is not None:
            force = tuple(effort * axis for axis in joint.direction)
            parts = [constant_wrench.Parameters(joint.child, force, 0.0, joint.point)]
        else:
            parts = [
                constant_wrench.Parameters(body, torque=torque)
                for body, torque in ((joint.child, effort), (joint.parent, -effort))
                if body != GROUND
            ]
        effects += [Effect('constant_wrench', name, part) for part in parts]
    return effects


def checked_wrench(model: Model, name: str, wrench: Wrench) -> Wrench:
    """The wrench, if it can act on that body or point. Raises InputError otherwise."""
    layout = model.layout
    choices = [*model.body_names, *(p.name for p in model.mechanism.points if not p.fixed)]
    if name not in choices:
        raise InputError('unknown body or point', key='wrench', value=name, choices=choices)
    D = layout.dimension
    if len(wrench.force) != D or not all(map(math.isfinite, (*wrench.force, wrench.torque))):
        numbers = [*wrench.force, wrench.torque]
        raise InputError(
            'not a wrench',
            key=name,
            value=numbers,
            expected=f'{D} finite forces and a finite torque',
        )
    if wrench.frame not in ('world', 'body'):
        raise InputError('unknown frame', key=name, value=wrench.frame, choices=('world', 'body'))
    turns = name in layout.body and len(layout.body[name].points) > 1
    if not turns and (wrench.torque or wrench.frame == 'body'):
        raise InputError('has no orientation: no torque on it, and no frame of its own', key=name)
    if wrench.at is not None:
        points = layout.body[name].points if name in layout.body else ()
        if wrench.at not in points:
            raise InputError('not a point of this body', key=name, value=wrench.at, choices=points)
    return wrench


def checked_effort(model: Model, joint: str, effort: float) -> float:
    """The effort, if that joint can take one. Raises InputError otherwise."""
    if joint not in model.joint_names:
        raise InputError('unknown joint', key='effort', value=joint, choices=model.joint_names)
    if not math.isfinite(effort):
        raise InputError('not an effort', key=joint, value=effort, expected='a finite number')
    ends = next(each for each in model.mechanism.joints if each.name == joint)
    for name in (ends.child, ends.parent):
        points = model.layout.body[name].points if name != GROUND else ()
        if ends.kind == 'revolute' and len(points) == 1:
            raise InputError(f'{name!r} has no orientation: no torque on it', key=joint)
    return float(effort)

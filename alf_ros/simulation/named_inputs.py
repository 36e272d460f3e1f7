"""Inputs by name, for linear models and for tangents: efforts, wrenches, targets of motors and
tendons.

- `joints.crank_pin.effort`: N m, or N of a length;
- `wrenches.coupler.force.x`, `wrenches.coupler.torque` (in space `.torque.x`): N, N m, in the
  world frame at the centre of mass of a body; the force on a point;
- `targets.crank_pin.position`, `.velocity`: what the motor of the scene is to follow.

An input adds to the inputs held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from alf_ros import effects as registry
from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.model.compile import Model
from alf_ros.simulation.full_names import full_name
from alf_ros.simulation.input_values import Inputs, Target, Wrench


@dataclass(frozen=True)
class NamedInput:
    """An input: its name, its unit, and what adds a value to Inputs (raises InputError)."""

    name: str
    unit: str
    added: Callable[[Inputs, float], Inputs]


def named_inputs(
    model: Model,
    effects: Sequence[Effect],
    names: Sequence[str],
    key: str = 'inputs',
) -> tuple[NamedInput, ...]:
    """The inputs of these names, or of ends of names that only one has. Raises InputError with the
    key."""
    known = {each.name: each for each in _all(model, effects)}
    return tuple(known[full_name(name, tuple(known), key)] for name in names)


def _all(model: Model, effects: Sequence[Effect]) -> list[NamedInput]:
    found = list[NamedInput]()
    space = model.layout.dimension == 3
    axes = 'xyz' if space else 'xy'
    for each in model.coordinates:
        unit = 'N m' if each.is_angle else 'N'
        name = f'joints.{each.name}.effort'
        found.append(NamedInput(name, unit, partial(_with_effort, each.name)))
    movable = (point.name for point in model.mechanism.points if not point.fixed)
    for name in (*model.body_names, *movable):
        for axis in range(len(axes)):
            path = f'wrenches.{name}.force.{axes[axis]}'
            found.append(NamedInput(path, 'N', partial(_with_wrench, name, axis, None, len(axes))))
        if name in model.body_names and model.layout.turns(name):
            for axis, end in enumerate(('.x', '.y', '.z') if space else ('',)):
                path = f'wrenches.{name}.torque{end}'
                added = partial(_with_wrench, name, None, axis, len(axes))
                found.append(NamedInput(path, 'N m', added))
    for effect in effects:
        module = registry.load(effect.kind)
        target = effect.target(model.coordinate_names)
        if hasattr(module, 'follows') and target is not None:
            follows = zip(('position', 'velocity'), module.follows(effect.parameters), strict=True)
            known = model.mechanism.coordinate
            joints = effect.coordinates  # none: a tendon over places
            angle = bool(joints) and all(known[joint].is_angle for joint in joints)
            for what, does in follows:
                if does:
                    unit = ('rad' if angle else 'm') + '/s' * (what == 'velocity')
                    path = f'targets.{target}.{what}'
                    found.append(
                        NamedInput(path, unit, partial(_with_target, effect, target, what))
                    )
    return found


def _with_effort(joint: str, inputs: Inputs, value: float) -> Inputs:
    now = inputs.efforts.get(joint, 0.0)
    held = now.shifted(value) if isinstance(now, Curve) else now + value
    return replace(inputs, efforts={**inputs.efforts, joint: held})


def _with_wrench(
    name: str,
    force: int | None,
    torque: int | None,
    dimension: int,
    inputs: Inputs,
    value: float,
) -> Inputs:
    none = Wrench((0.0,) * dimension)
    now = inputs.wrenches.get(name, none)
    # one that turns with the body, or acts elsewhere, is no sum with a wrench in the world
    is_beside = now.frame != 'world' or now.at is not None
    if is_beside:
        now = inputs.added.get(name, none)
    if force is not None:
        whole = np.array(now.force, dtype=float)
        whole[force] += value
        changed = replace(now, force=tuple(whole.tolist()))
    else:
        turning = np.zeros(3 if dimension == 3 else 1)
        turning[:] = now.torque
        turning[torque] += value
        held = tuple(turning.tolist()) if dimension == 3 else float(turning[0])
        changed = replace(now, torque=held)
    if is_beside:
        return replace(inputs, added={**inputs.added, name: changed})
    return replace(inputs, wrenches={**inputs.wrenches, name: changed})


def _with_target(effect: Effect, joint: str, what: str, inputs: Inputs, value: float) -> Inputs:
    given = inputs.targets.get(joint, Target())
    own = getattr(given, what)
    now = getattr(effect.parameters, what) if own is None else own
    if now is not None and not isinstance(now, float | int):
        raise InputError(
            'the motor follows a curve: no target beside it', key=f'targets.{joint}.{what}'
        )
    changed = replace(given, **{what: (now or 0.0) + value})
    speed = effect.parameters.velocity
    if what == 'position' and given.velocity is None and isinstance(speed, float):
        changed = replace(changed, velocity=speed)  # it would become the slope of x*
    return replace(inputs, targets={**inputs.targets, joint: changed})

"""Whether an input can be held on a mechanism: checked before it acts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from alf_ros import effects as registry
from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.errors import InputError
from alf_ros.mechanism import GROUND
from alf_ros.model.compile import Model
from alf_ros.simulation.applied import Target, Wrench


def follows(effects: Sequence[Effect], joint: str) -> tuple[bool, bool]:
    """Whether an effect on this joint coordinate follows positions, and velocities."""
    positions, velocities = False, False
    for effect in effects:
        module = registry.load(effect.kind)
        if hasattr(module, 'follows') and effect.parameters.joint == joint:
            both = module.follows(effect.parameters)
            positions, velocities = positions or both[0], velocities or both[1]
    return positions, velocities


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
    for name in (coordinate.joint.child, coordinate.joint.parent):
        if coordinate.is_angle and name != GROUND and not model.layout.turns(name):
            raise InputError(f'{name!r} has no orientation: no torque on it', key=joint)
    return effort if isinstance(effort, Curve) else float(effort)

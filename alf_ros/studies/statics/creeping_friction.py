"""Notes about dry friction, which a linear model has only where it creeps."""

from __future__ import annotations

import numpy as np

from alf_ros import effects as registry
from alf_ros import kernel
from alf_ros.effects import contract
from alf_ros.effects.contract import Effect
from alf_ros.simulation.packed_effects import loaded
from alf_ros.studies.statics.instant import Instant


def creeping(instant: Instant) -> list[str]:
    """A note for each effect with dry friction: how fast it may slide for its slope to hold."""
    slopes = ((each, _below(instant, each)) for each in instant.loads.effects)
    return [_said(instant, each, below) for each, below in slopes if below is not None]


def _said(instant: Instant, effect: Effect, below: float) -> str:
    if loaded(effect) is not None and not instant.rubbing.size:
        return f'{effect.label}: dry friction under a reaction is left out'
    limit = f'{below:g} {_unit(instant, effect)}'
    if instant.qd.any():
        return (
            f'{effect.label}: dry friction has the slope of this instant, for changes of speed '
            f'far below {limit}, or below the speed at which it slides here'
        )
    return (
        f'{effect.label}: dry friction is taken as viscous, which holds while it slides far more '
        f'slowly than {limit}'
    )


def _below(instant: Instant, effect: Effect) -> float | None:
    """The speed below which an effect is linear; None if it does not rub here."""
    module, p = registry.load(effect.kind), effect.parameters
    below: float | None = module.creeping(p) if hasattr(module, 'creeping') else None
    if below is None or not hasattr(module, 'at_rest') or module.at_rest(p) != contract.CONTACT:
        return below
    Q, part = np.zeros_like(instant.q), instant.loads.applied.each[effect.label].effects
    kernel.applied_forces(part, instant.t, instant.q, instant.qd, instant.near, Q)
    return below if Q.any() else None  # it touches nothing


def _unit(instant: Instant, effect: Effect) -> str:
    known, joints = instant.model.mechanism.coordinate, effect.coordinates
    return 'rad/s' if joints and all(known[name].is_angle for name in joints) else 'm/s'

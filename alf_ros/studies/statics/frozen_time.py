"""Notes about drives, motors and tables, which statics take at one instant."""

from __future__ import annotations

import numpy as np

from alf_ros.effects.contract import Effect
from alf_ros.effects.contract.trajectory import Curve
from alf_ros.kernel import Effects
from alf_ros.model.compile import Model
from alf_ros.simulation.packed_effects import kinds_of
from alf_ros.studies.statics.instant import Instant, forces

_LATER = (0.1234, 1.618)  # s, after which a force that depends on time has another value


def standing_still(model: Model, t: float) -> list[str]:
    """Notes about what moves as a function of time and stands still at rest, at t (s)."""
    found = [f'drives are frozen at t = {t:g} s'] if model.mechanism.drives else []
    names = ', '.join(joint.name for joint in model.mechanism.joints if joint.motion)
    if names:
        found.append(f'{names}: what moves there as a function of time stands still')
    return found


def read_at(instant: Instant) -> list[str]:
    """A note about the loads that depend on time: tables, motors that follow them, held inputs
    over time, and effects of users. They are as at this instant."""
    applied = instant.loads.applied
    efforts = applied.inputs.efforts.items()
    names = [f'the effort on {name}' for name, what in efforts if isinstance(what, Curve)]
    if applied.instants.size or _changes(instant, applied.assembled.effects):
        each = applied.each
        names += [
            effect.label
            for effect in applied.effects
            if _has_kinks(instant.model, effect) or _changes(instant, each[effect.label].effects)
        ]
    if not names:
        return []
    return [f'{", ".join(names)}: read at t = {instant.t:g} s, as a function of time']


def _has_kinks(model: Model, effect: Effect) -> bool:
    """Whether an effect says instants of its own, as tables do."""
    return any(kind.packed.instants.size for kind in kinds_of((effect,), model.layout))


def _changes(instant: Instant, effects: Effects) -> bool:
    """Whether forces are others later, where nothing has moved."""
    at = instant.q, instant.qd, instant.near, np.zeros(0)
    now, *later = (forces(effects, t, *at) for t in (instant.t, *(instant.t + t for t in _LATER)))
    return not all(np.array_equal(now, each, equal_nan=True) for each in later)

"""Whether the potentials of effects of users belong to their forces: Q = -∂V/∂q at rest.

A wrong potential leaves the motion right and the energy wrong, by which runs are judged. So the
force is compared with differences of the potential along the free directions, at positions of the
walk. An effect that also pushes by itself differs too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from alf_ros import effects as registry
from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Effects
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import Linearised
from alf_ros.scene.scene import Scene
from alf_ros.simulation.packed_effects import kinds_of, listed

_PLACES = 24  # of the walk, at most
_STEP = 1e-3  # of the size of the mechanism
_OFF = 0.01  # of the forces: more is no kink on the way


def unlike_forces(scene: Scene, model: Model, positions: Sequence[Floats]) -> Iterator[str]:
    """Labels of effects whose potential does not belong to their force, and how far it is off.
    positions: (blocks D,) of the model."""
    chosen = positions[:: -(-len(positions) // _PLACES)]
    for effect in scene.effects:
        if effect.kind in registry.own() or not hasattr(registry.load(effect.kind), 'potential'):
            continue
        packed = listed(kinds_of([effect], model.layout))
        forces, slopes = zip(*(_along(packed, Linearised(model, q)) for q in chosen), strict=True)
        push, fall = np.concatenate(forces), -np.concatenate(slopes)
        off, size = np.abs(push - fall).sum(), np.maximum(np.abs(push), np.abs(fall)).sum()
        if not off <= _OFF * size:
            yield f'{effect.label} by {100 * off / size:.3g} %'


def _along(effects: Effects, at: Linearised) -> tuple[Floats, Floats]:
    """(freedoms,) the force and the slope of the potential along the free directions, per m."""
    model, q, n = at.model, at.q, at.model.n
    angles, step = model.system.angles, _STEP * model.size
    places, turns = np.zeros(angles.c.size), np.zeros(angles.c.size // 2, dtype=np.int64)
    near, Q = np.zeros(turns.size), np.zeros(q.size)
    kernel.violation(model.unit, angles, q, places)
    kernel.nearby(places, turns, near)
    kernel.applied_forces(effects, 0.0, q, np.zeros(q.size), near, Q)

    def energy(direction: Floats, distance: float) -> float:
        there = q.copy()
        there[:n] += distance * direction
        return float(kernel.potential_energy(effects, 0.0, there, near))

    def slope(z: Floats) -> float:
        twice = energy(z, 2.0 * step) - energy(z, -2.0 * step)
        return (8.0 * (energy(z, step) - energy(z, -step)) - twice) / (12.0 * step)

    return at.free.T @ Q[:n], np.array([slope(z) for z in at.free.T])

"""Angles that begin beyond half a turn, with effects that count from there.

In the plane an angle is the difference of two directions, each in (-π, π] as drawn: bars drawn at
3.2 and 3.1 rad begin at -6.18 rad, not at 0.1. A stop or a spring between them would act over a
whole turn at once, which the drawing does not show.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.effects import Effect
from alf_ros.scene.scene import Scene
from alf_ros.simulation.packed_effects import kinds_of, listed
from alf_ros.simulation.simulation import Simulation

_SAME = 1e-9  # of the force
_TURNS = 2  # further ones at which a stop may act, which does not act at the start


def far_angles(scene: Scene, simulation: Simulation) -> Iterator[str]:
    """Each angle that begins beyond half a turn, with the labels of effects that would do less if
    it began within half a turn, or may do so later. simulation: of the scene, at its start."""
    joints = simulation.sample().joint_positions
    for coordinate, value in zip(simulation.model.coordinates, joints, strict=True):
        turns = round(value / (2.0 * math.pi))
        if not coordinate.is_angle or not turns:
            continue
        back = -2.0 * math.pi * turns
        pushing = [
            effect.label
            for effect in scene.effects
            if _does_less(effect, simulation, coordinate.place, back)
        ]
        if pushing:
            yield (
                f'{coordinate.name} begins at {value:.4g} rad, not at {value + back:.4g}; from '
                f'there it counts for {", ".join(pushing)}'
            )


def _does_less(effect: Effect, simulation: Simulation, place: int, back: float) -> bool:
    """Whether the force counts whole turns of this angle, and is no greater `back` (rad)."""
    model, state = simulation.model, simulation.state
    angles, spins, near = np.zeros((3, state.turns.size))
    rows = model.system.angles
    kernel.counted_angles(model.unit, rows, state.q, state.qd, state.turns, angles, spins, near)
    packed = listed(kinds_of([effect], model.layout))

    def force(turned: float) -> Floats:
        Q, there = np.zeros(state.q.size), near.copy()
        there[place] += turned
        kernel.applied_forces(packed, simulation.t, state.q, state.qd, there, Q)
        return Q

    forces = [force(n * back) for n in range(_TURNS + 1)]
    here, there, *_ = sizes = [np.abs(each).max() for each in forces]
    differ = max(np.abs(each - forces[0]).max() for each in forces)
    return bool(differ > _SAME * max(sizes) and not here < there)

"""Thirty starting states of a mechanism that passes singular positions, as motions of 3 s.

Rest exactly in a singular position is excluded: where branches cross, the equations do not
determine the motion that starts there, so no exact motion exists for comparison. It exists with a
speed along a branch, or at rest at any distance from the position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.exact import cost as reduced
from alf_ros.studies.exact import motions, one_freedom
from alf_ros.studies.exact.cost import Cost
from alf_ros.studies.exact.motions import ExactMotion

GRID = 0.5  # s, where the motions are looked at and the adaptive steps come together
TIMES = tuple(GRID * k for k in range(7))
_TOLERANCES = 10.0 ** -np.arange(1.0, 13.1, 0.5)  # to 1e-13: below that is rounding
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))  # rad: angles of a multiple lie all over the circle


@dataclass(frozen=True)
class StartingState:
    """A motion, and the one freedom with its θ (rad) and θ̇ (rad/s) at the start."""

    motion: ExactMotion
    alone: one_freedom.OneFreedom
    theta: float
    rate: float

    @cached_property
    def costs(self) -> tuple[Cost, ...]:
        """The cost of the one freedom alone, at tolerances closer than in the campaign."""
        model = Simulation(self.motion.scene()).model
        weight = max(body.mass for body in model.mechanism.bodies) * one_freedom.GRAVITY
        # as the kernel has it, for forces that are weights of two rods at a point
        slowest = math.sqrt(model.size * weight / model.mass_scale)
        costs = (
            reduced.integrate(
                self.alone,
                (self.theta, self.rate),
                self.motion.times,
                self.motion.exact(),
                float(tolerance),
                model.size,
                slowest,
            )
            for tolerance in _TOLERANCES
        )
        return tuple(cost for cost in costs if cost is not None)


def _offsets() -> list[tuple[float, float]]:
    """Angle beyond a singular position, rad (there is another at π), and speed, rad/s."""
    speeds = (0.2, -0.2, 1.0, -1.0, 3.0, -3.0, 8.0, -8.0, 0.05, -5.0)
    moving = [(_GOLDEN * (k + 1) % (2.0 * math.pi), rate) for k, rate in enumerate(speeds)]
    within = [(0.0, rate) for rate in (0.3, -0.3, 2.0, -8.0)]
    opposite = [(math.pi, rate) for rate in (-0.3, 2.0, -2.0, 8.0)]
    beside = [(angle, 0.0) for angle in (1e-3, -1e-3, 1e-4, -1e-4, 1e-5, -1e-5)]
    beside += [(math.pi + 1e-4, 0.0), (math.pi - 1e-4, 0.0)]
    at_rest = [(angle, 0.0) for angle in (0.4, 1.9, 3.5, 5.0)]
    return moving + within + opposite + beside + at_rest


@cache
def starting_states(mechanism: str) -> tuple[StartingState, ...]:
    """All over the circle, slow and fast to either side, in the positions, at rest beside them."""
    crank = mechanism == 'slider_crank'
    alone = one_freedom.slider_crank() if crank else one_freedom.four_bars(2)
    singular = math.pi / 2 if crank else 0.0
    return tuple(
        StartingState(
            motions.start(mechanism, offset, rate, TIMES), alone, singular + offset, rate
        )
        for offset, rate in _offsets()
    )

"""Diagnostics of a sample: violations, rank, distance to a singular position, adequate step."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from alf_ros.simulation.dynamics import Dynamics
from alf_ros.simulation.resolution import Resolution, nice

_TURN = 1.5  # rad in a step, by which angles are surely followed …
_MOST_TURNED = 3.0  # … and beyond which whole turns are lost
_FEW = 300  # coordinates, up to which eigenvalues are cheap


class Diagnostics:
    """The health of a sample: violations, iterations, rank, cost. It keeps nothing itself."""

    def __init__(
        self,
        sample: Dynamics,
        iterations: int,
        step_cost: float,
        resolution: Callable[[], Resolution],
    ) -> None:
        self._sample = sample
        self.iterations = iterations  # most in one solve of the last call
        self.step_cost = step_cost  # s of wall time per step of the last call
        self._resolution = resolution

    @property
    def resolution(self) -> Resolution:
        """How well the steps so far resolve the motion. Looking for positions that lengths miss
        takes some tenths of a second, once, and only after a step beside a singular position."""
        return self._resolution()

    @property
    def adequate_step(self) -> float:
        """A sufficient step (s): the step of the run if it suffices, NaN without a measurement.

        Where steps are too long it is at most half of their stability limit at this instant.
        """
        found = self.resolution
        if found.too_long and self._sample.model.n <= _FEW:
            from alf_ros.simulation.stiffness import stiffest  # seldom needed

            _, mode = stiffest([self._sample])
            limit = mode.step(self._sample._solver.integrator)
            if limit < found.step:
                return found.within(0.5 * limit)
        return found.adequate

    @property
    def trouble(self) -> str:
        """A report of steps that are too long, with a sufficient one; empty if they are not."""
        return self.resolution.trouble(self.adequate_step) or self._lost_turns

    @property
    def _lost_turns(self) -> str:
        """A report of an angle that turns too far in a fixed step for its turns to be counted."""
        sample, method = self._sample, self._sample._solver.method
        if method.embedded.size or not sample._spins.size:
            return ''
        h, fastest = sample._solver.step, np.abs(sample._spins).max()
        if h * fastest <= _MOST_TURNED:
            return ''
        return (
            f'a body turns by {h * fastest:.2g} rad in a step of {h:g} s: whole turns of angles '
            f'are not counted right; take {nice(_TURN / fastest):g} s or less, or an adaptive '
            'integrator'
        )

    @property
    def position_violation(self) -> float:
        """Largest distance by which a constraint is open, m."""
        return float(np.max(np.abs(self._sample.phi) * self._sample._scale, initial=0.0))

    @property
    def velocity_violation(self) -> float:
        """Largest speed at which a constraint opens, m/s."""
        return float(np.max(np.abs(self._sample.phi_dot) * self._sample._scale, initial=0.0))

    @property
    def rank(self) -> int:
        """Rank of Φ_q, from the factor of A."""
        return round(self._sample._effective_rank)

    @property
    def redundant(self) -> int:
        """Number of constraint rows that depend on the others here."""
        return self._sample._redundant

    @property
    def distance(self) -> float:
        """Distance to a singular position: the least singular value σ of the scaled Φ_q among rows
        that are independent at ordinary positions nearby; 1 without any."""
        return self._sample._softest[0]

    @property
    def distance_error(self) -> float:
        """Its error bound, from rounding and from the residual of its iteration."""
        return self._sample._softest[1]

    @property
    def distance_if_known(self) -> float:
        """The same, where reactions or multipliers were asked for; else infinite: alone it costs
        more than a small mechanism's step."""
        return self.distance if '_linearised' in vars(self._sample) else math.inf

    @property
    def singular(self) -> bool:
        """Whether the rank is lower here than at ordinary positions."""
        return self._sample._singular

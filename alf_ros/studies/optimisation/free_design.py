"""The motion of a design that forces decide on, with the tangents of its run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.simulation.displaced_scenes import DisplacedScenes
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.time_kinks import time_kinks
from alf_ros.studies.optimisation.design_numbers import DesignNumbers, displaced
from alf_ros.studies.optimisation.instants import PointTrack, path
from alf_ros.studies.optimisation.near_samples import near


class FreeDesign:
    """The motion of a scene with values of its numbers, over a duration (s), with its tangents.

    Instants between samples are read from the polynomial of six samples. Raises AlfError for a
    design that cannot run, and for numbers without a tangent.
    """

    def __init__(
        self,
        numbers: DesignNumbers,
        values: Floats,
        duration: float,
        period: float,
        before: Simulation | None = None,
    ) -> None:
        """`before`: a simulation with other values, whose slopes are kept where they hold."""
        self._numbers, self._values = numbers, values
        scene = numbers.framed_at(values)
        self.simulation = Simulation(scene, tangents=numbers.names, like=before)
        every = max(1, round(period / self.simulation.h))
        self.samples: Sequence[Sample] = list(self.simulation.run(duration, every))
        for name in numbers.names:  # refused where a singular position unfolds
            _ = self.samples[-1].tangents[name]
        self.t = np.array([sample.t for sample in self.samples])

    @cached_property
    def kinks(self) -> Floats:
        """The instants (s) at which functions of time of drives and effects have a kink."""
        n = self.t.size - 1
        return time_kinks(self.simulation, 0.0, n, float(self.t[-1]) / n)

    def check_held(self, instants: Sequence[float], what: str) -> None:
        """Nothing: tangents refuse numbers that move the instant of a jump."""

    @property
    def trouble(self) -> str:
        """Steps of the run that are too long, in words; or empty."""
        return self.samples[-1].diagnostics.trouble

    @cached_property
    def displaced(self) -> DisplacedScenes:
        """The scenes beside it."""
        return displaced(self._numbers, self._values, self.simulation)

    def tangent(self, n: int) -> tuple[Floats, Floats]:
        """δq, δq̇ (P, blocks D) of sample n."""
        state = self.samples[n].state
        dq, dqd = state.tangents.reshape(-1, 2, state.q.size).transpose(1, 0, 2)
        return dq, dqd

    def places(self, point: str, times: Floats) -> tuple[Floats, Floats]:
        """(K, D) positions and velocities of a point at instants (s)."""
        x, v = path(self.samples, point)
        weights = self._weights(times)
        return weights @ x, weights @ v

    def track(self, point: str, times: Floats) -> PointTrack:
        """A point at instants (s)."""
        weights = self._weights(times)
        x, v = path(self.samples, point)
        layout = self.simulation.model.layout
        block = layout.of_point[point]
        dx = np.array(
            [
                self.tangent(n)[0].reshape(len(self._values), -1, layout.dimension)[:, block]
                for n in range(len(self.samples))
            ]
        )
        return PointTrack(weights @ x, weights @ v, np.tensordot(weights, dx, axes=(1, 0)))

    def _weights(self, times: Floats) -> Floats:
        """(K, N) of the samples at instants."""
        found = np.zeros((times.size, self.t.size))
        for row, t in zip(found, times.tolist(), strict=True):
            window = near(self.t, t)
            row[window.of] = window.at(t)
        return found

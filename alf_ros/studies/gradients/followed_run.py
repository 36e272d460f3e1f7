"""A run whose tangents are read: the gradient where no adjoint takes the steps back.

The run gives the number. Its derivatives are read where they count, from the tangents of the
states on the way. These are kept, up to a limit of memory; behind the last one the run is made
again. The cost grows with the number of parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.state import State
from alf_ros.studies.gradients.bars import Bars
from alf_ros.studies.gradients.legs import Leg, RunInstant, RunOfLegs
from alf_ros.studies.gradients.observed_number import ObservedNumber

_MEMORY = 256e6  # bytes for the states on the way


class FollowedRun(RunOfLegs):
    """The run of a simulation from its present on, which it moves; steps have tangents."""

    def __init__(
        self, simulation: Simulation, names: Sequence[str], memory: float = _MEMORY
    ) -> None:
        super().__init__(simulation, names)
        simulation._follow(self.following, self._from_start)
        state = simulation.state
        self._room = int(memory / (state.q.nbytes + state.qd.nbytes + state.tangents.nbytes))
        self._kept: dict[int, State] = {}  # by their steps, with the inputs up to them

    def restart(self) -> None:
        super().restart()
        self._kept.clear()

    def go_on(self, steps: int) -> Iterator[Leg]:
        """Steps of the grid, with the inputs held now. Raises StepError."""
        leg = Leg(self._simulation.state, steps)
        self._begin(leg)
        yield leg
        self._go_to(leg.end)

    def samples(self, steps: Sequence[int]) -> Iterator[Sample]:
        """Samples at these steps of the last leg, in order, with its inputs."""
        for step in steps:
            self._go_to(step)
            if len(self._kept) < self._room:
                self._kept[step] = self._simulation.state
            yield self._simulation.sample()

    def _go_to(self, step: int) -> None:
        if step > self._simulation.step_index:
            self._simulation.step(step - self._simulation.step_index)

    def derivatives(self, number: ObservedNumber, weights: Mapping[RunInstant, float]) -> Floats:
        """(names,) the derivatives of the sum of `weights` times the number at their instants, by
        the numbers of the scene. Raises StepError, and InputError by a name without a
        derivative."""
        self._check_unfolding(max(weights).step)
        simulation, K = self._simulation, len(self.following.names)
        total = Bars.of(simulation.model, K)
        for leg in self._legs:
            simulation.restore(leg.state)
            for instant in sorted(filter(leg.has, weights)):
                if not instant.begins and instant.step in self._kept:
                    simulation.restore(self._kept[instant.step])
                self._go_to(instant.step)
                self._add(number, weights[instant], total)
        return np.asarray(total.numbers + self._products.by_arrays(total.arrays))

    def _add(self, number: ObservedNumber, weight: float, total: Bars) -> None:
        """The derivatives at the present."""
        simulation, K = self._simulation, len(self.following.names)
        own = Bars.of(simulation.model, K)
        number.add(simulation.sample(), weight, own)
        tangents = simulation.state.tangents.reshape(K, 2, -1)
        total.numbers[:] += own.numbers + tangents[:, 0] @ own.q + tangents[:, 1] @ own.qd
        for name, array in own.arrays.items():
            total.arrays[name] += array

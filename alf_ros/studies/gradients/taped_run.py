"""A run that is taken back: legs with the same inputs, short enough to be kept in memory.

The first pass notes the states where legs begin. A leg is run again, written down, when its turn
comes; the last one is still there. So one leg is in memory, and a state for each other one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.simulation.adjoint_following import AdjointFollowing, NoRoom, TakenBack
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.gradients.bars import Bars
from alf_ros.studies.gradients.legs import Leg, RunInstant, RunOfLegs
from alf_ros.studies.gradients.observed_number import ObservedNumber

_MEMORY = 256e6  # bytes for the steps of a leg
_INNER = 16  # steps of an adaptive method for one of the grid, at first
# of the step of the grid, and of t: so near before an instant of the grid a step may end that ends
# there, if a kink over time is there (kernel/kinks_over_time.py)
_SAME, _ROUNDED = 2e-12, 1e-14


class TapedRun(RunOfLegs):
    """The run of a simulation from its present on, which it moves.

    Raises InputError for names that the motion has no derivative by.
    """

    def __init__(
        self, simulation: Simulation, names: Sequence[str], memory: float = _MEMORY
    ) -> None:
        simulation._begin_writing()
        super().__init__(simulation, names)
        solver = simulation.solver
        self._adjoint = AdjointFollowing(simulation._run.stepper, simulation.model, self._products)
        per_step = _INNER if solver.method.embedded.size else 1
        self._longest = max(1, int(memory / (self._adjoint.bytes_of_step * per_step)))
        self._per_step = per_step

    def go_on(self, steps: int) -> Iterator[Leg]:
        """Steps of the grid, with the inputs held now, leg by leg. Raises StepError."""
        while steps > 0:
            stretches = self.following.places.stretches(self._simulation.step_index, steps)
            n = min(stretches[0], self._longest)
            self._begin(Leg(self._simulation.state, n))
            self._write_down(self._legs[-1])
            steps -= n
            yield self._legs[-1]

    def _write_down(self, leg: Leg) -> None:
        self._adjoint.provide(leg.steps * self._per_step)
        while True:
            try:
                self._simulation._write_down(self._adjoint, leg.steps)
                return
            except NoRoom:
                self._simulation.restore(leg.state)

    def samples(self, steps: Sequence[int]) -> Iterator[Sample]:
        """Samples at these steps of the last leg, in order, with its inputs."""
        leg = self._legs[-1]
        for step in steps:
            yield self._sample(leg, step)

    def _sample(self, leg: Leg, step: int) -> Sample:
        state = self._simulation.state
        if step != leg.end:
            n = self._adjoint.begun(self._written(leg, step))
            state = replace(leg.state, step=step, q=n.q, qd=n.qd, turns=n.turns, sums=n.sums)
        return self._simulation._sample(step * self._simulation.h, state, None)

    def _written(self, leg: Leg, step: int) -> int:
        """How many of the written steps lie before a step of the grid."""
        if step == leg.state.step:
            return 0
        ends, h = self._adjoint.ends(), self._simulation.h
        at = step * h
        return int(np.searchsorted(ends, at - _SAME * h - _ROUNDED * at)) + 1

    # ----------------------------------------------------------------------------------- back

    def derivatives(self, number: ObservedNumber, weights: Mapping[RunInstant, float]) -> Floats:
        """(names,) the derivatives of the sum of `weights` times the number at their instants, by
        the numbers of the scene. Raises StepError, and InputError by a name without a
        derivative."""
        self._check_unfolding(max(weights).step)
        bars = Bars.of(self._simulation.model, len(self.following.names))
        sums: dict[str, Floats] = {}
        for leg in reversed(self._legs):
            if leg is not self._legs[-1]:
                self._repeat(leg)
            back = self._leg_back(leg, number, weights, bars)
            bars.q[:], bars.qd[:] = back.q, back.qd
            for name, array in back.arrays.items():
                sums[name] = sums.get(name, 0.0) + array
            by_params = self._products.by_params(leg.state.inputs, back.params)
            bars.numbers[:] += by_params * self.following.places.acting(leg.state.step)
        begin = {'q': bars.q, 'qd': bars.qd} if self._from_start else {}
        return bars.numbers + self._products.by_arrays({**sums, **bars.arrays, **begin})

    def _repeat(self, leg: Leg) -> None:
        self._simulation.restore(leg.state)
        self._write_down(leg)

    def _leg_back(
        self, leg: Leg, number: ObservedNumber, weights: Mapping[RunInstant, float], bars: Bars
    ) -> TakenBack:
        """A leg, taken back from `bars` where it ends; what does not come through the state is
        added to these."""
        instants = sorted(filter(leg.has, weights), reverse=True)
        while True:
            own = Bars.of(self._simulation.model, len(self.following.names))
            numbers = np.zeros_like(own.numbers)
            self._adjoint.begin(bars.q, bars.qd)
            try:
                for instant in instants:
                    self._adjoint.take_back(self._written(leg, instant.step))
                    own.q[:], own.qd[:], own.numbers[:] = 0.0, 0.0, 0.0
                    number.add(self._sample(leg, instant.step), weights[instant], own)
                    before = instant.step - (not instant.begins)
                    numbers += own.numbers * self.following.places.acting(max(0, before))
                    self._adjoint.add(own.q, own.qd)
                self._adjoint.take_back(0)
            except NoRoom:
                self._repeat(leg)
                continue
            for name, array in own.arrays.items():
                bars.arrays[name] += array
            bars.numbers[:] += numbers
            return self._adjoint.taken_back()

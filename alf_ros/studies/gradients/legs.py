"""Legs of a run whose numbers are differentiated: steps of the grid with the same inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism.form_of_rows import form_of
from alf_ros.simulation.adjoint_following import SUMS
from alf_ros.simulation.displaced_scenes import Middle
from alf_ros.simulation.quantity_tangents import QuantityTangents
from alf_ros.simulation.simulation import Simulation
from alf_ros.simulation.slope_products import SlopeProducts
from alf_ros.simulation.state import State
from alf_ros.simulation.time_kinks import time_kinks

_FORMS = ('angle_b', 'angle_c', 'angle_term', 'length_b', 'length_c', 'length_term')
_ARRAYS = (*SUMS, *_FORMS, 'prescribed', 'q', 'qd')


class RunInstant(NamedTuple):
    """A step of a run, with the inputs that act up to it, or with those from it on (`begins`):
    quantities such as efforts jump where an input changes."""

    step: int
    begins: bool = False


class Leg(NamedTuple):
    """Steps of the grid from a state, with its inputs."""

    state: State
    steps: int

    @property
    def end(self) -> int:
        """The step where it ends."""
        return self.state.step + self.steps

    @property
    def begin(self) -> RunInstant:
        """Where it begins, with its inputs."""
        return RunInstant(self.state.step, begins=True)

    def has(self, instant: RunInstant) -> bool:
        """Whether an instant belongs to it, and not to the leg before or behind."""
        return instant == self.begin or (
            not instant.begins and self.state.step < instant.step <= self.end
        )


class RunOfLegs:
    """The run of a simulation from its present on, which it moves.

    `kinks` (s): at which functions of time of drives, effects and inputs have a kink. Raises
    InputError for names that the motion has no derivative by.
    """

    def __init__(self, simulation: Simulation, names: Sequence[str]) -> None:
        self._simulation = simulation
        self.following = simulation._following_of(names)
        self.displaced = QuantityTangents(self.following, Middle.of(simulation)).displaced
        self._check_begin()
        self._products = SlopeProducts(simulation.model, self.following.slopes, _ARRAYS)
        self._legs: list[Leg] = []
        self.kinks: Floats = np.zeros(0)

    def _begin(self, leg: Leg) -> None:
        """Note a leg, from the present with its inputs on."""
        self._legs.append(leg)
        simulation = self._simulation
        kinks = time_kinks(simulation, simulation.t, leg.steps, simulation.h)
        self.kinks = np.union1d(self.kinks, kinks)

    def restart(self) -> None:
        """Back to where the run began, without legs. The slopes of the scene stay."""
        if self._legs:
            self._simulation.restore(self._legs[0].state)
            self._legs.clear()

    def _check_begin(self) -> None:
        """A run from another state than the scene's, which is given, does not change with where
        the scene begins, and not in a consistent way with lengths."""
        simulation, (own, here) = self._simulation, self._begins()
        self._from_start = here.step == 0 and all(
            map(np.array_equal, (own.q, own.qd), (here.q, here.qd))
        )
        if self._from_start:
            return
        for name, slopes in zip(self.following.names, self.following.slopes, strict=True):
            if name in self.following.placing or not slopes.acts:
                raise InputError(
                    'no gradient: the run does not begin where its scene begins',
                    key=name,
                    value=f't = {simulation.t:g} s',
                )

    def _begins(self) -> tuple[State, State]:
        return self._simulation.initial_state, self._simulation.state

    def _check_unfolding(self, last: int) -> None:
        """Refuse lengths and drives that unfold a singular position passed before a step."""
        following, simulation = self.following, self._simulation
        if not following.placing:
            return
        with form_of(simulation.model.layout.asked):
            watched = Simulation(simulation.scene, **asdict(simulation.solver), watch=True)
        for leg in self._legs:
            steps = min(leg.steps, last - leg.state.step)
            if steps <= 0:
                return
            watched.restore(leg.state)
            watched.step(steps)
            for passed in watched.passes:
                for name in following.unfolded_by(passed):
                    told = f'it unfolds the singular position passed at t = {passed.t:.6g} s'
                    raise InputError(f'no gradient: {told}', key=name)

"""A requested accuracy in metres: integrator and tolerance that keep to it, found by trials.

The scene is run from its start, as often as needed, and the setting with the fewest evaluations is
chosen. The choice reads no clock, so the same scene always gets the same. See doc/performance.md.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import StepError
from alf_ros.kernel import Status
from alf_ros.model.compile import Model
from alf_ros.scene.scene import Solver
from alf_ros.simulation.state import State

HORIZON = 10.0  # s of examined motion, less if that needs too much
SPACING = 0.1  # s between the instants compared
WORK = 2e7  # (coordinates + OVERHEAD) times evaluations of one run: about a second
OVERHEAD = 20
MARGIN = 2.0  # the chosen setting errs less than the request by this
FINEST = 1e-12  # tolerance: below it rounding decides
LOOSEST = 1e-3
DECADE = 10.0**0.5  # between two tolerances that are tried
RETRIES = 3  # of the adaptive integrator, with a tenth of the tolerance each time
FIXED = {'rk4': 4, 'dop853': 12}  # evaluations in a step
IMPLICIT = 'esdirk43_adaptive'  # with stiff effects, if it needs fewer
DEAR = 1.8  # explicit evaluations that cost as much as an implicit one (benchmark/stiff.py)


class Trial(Protocol):
    """Factory of trial runs: a `Simulation` of the scene with other settings."""

    @property
    def model(self) -> Model:
        """The model of the scene."""

    @property
    def t(self) -> float:
        """Simulated time, s."""

    @property
    def h(self) -> float:
        """Time step, s."""

    @property
    def state(self) -> State:
        """A copy of the state at t."""

    @property
    def evaluations(self) -> int:
        """Stages evaluated so far."""

    @property
    def yields(self) -> bool:
        """Whether an effect declares its derivatives, so that an implicit integrator has a use."""

    def step(self, n: int) -> None:
        """Take n steps. Raises StepError."""


@dataclass(frozen=True)
class Budget:
    """The choice for an accuracy.

    solver: with it in place. asked, estimate (m): the largest distance of a point, at any instant
    compared, from the same run at a far smaller tolerance, plus the error of that run. It holds
    for `horizon` (s) from the start of the scene without inputs; it is no bound.
    """

    solver: Solver
    asked: float
    estimate: float
    horizon: float

    @property
    def met(self) -> bool:
        """Whether the estimate is below the requested error."""
        return self.estimate <= self.asked


def pick(solver: Solver, made: Callable[[Solver], Trial], explicit: bool = False) -> Budget:
    """The settings for the accuracy of `solver`, on its grid; `made` makes a run of the scene;
    `explicit`: among explicit integrators."""
    return _Trials(solver, made, explicit).budget()


class _Trials:
    def __init__(self, solver: Solver, made: Callable[[Solver], Trial], explicit: bool) -> None:
        assert solver.accuracy is not None
        self._explicit = explicit
        self._solver, self._accuracy, self._made = solver, solver.accuracy, made
        h = solver.step
        self._stride = max(1, round(SPACING / h))  # steps between two instants
        self._spacing = self._stride * h
        model = made(solver).model
        self._size, self._dimension = model.size, model.layout.dimension
        self._most = WORK / (OVERHEAD + model.layout.dimension * model.layout.movable)
        whole = min(HORIZON, 0.5 * self._most * h / FIXED['dop853'])
        self._instants = max(1, math.floor(whole / self._spacing + 1e-6))

    def budget(self) -> Budget:
        most = LOOSEST / DECADE**2
        fine = min(max(1e-4 * self._accuracy / self._size, FINEST), most)
        self._best = self._path(self._adaptive(fine, coarse=True))
        while self._starved and 10.0 * fine <= most:  # by a force that jumps
            fine *= 10.0
            self._best = self._path(self._adaptive(fine, coarse=True))
        check = self._path(self._adaptive(10.0 * fine, coarse=True))
        self._instants = len(self._best)  # as far as it came
        self._own = self._distance(check)
        found = None
        for candidate in self._candidates(fine):
            tried = self._judged(candidate)
            if found is None or tried.estimate < found.estimate:
                found = tried
            if self._good(tried.estimate):
                return tried
            if self._instants == 0:
                break  # no step can be made
        assert found is not None  # there is always a candidate
        return found

    def _candidates(self, fine: float) -> Iterator[Solver]:
        """By the evaluations they take; at last the adaptive integrator, tighter and tighter."""
        tolerance, evaluations = self._tolerance(fine)
        h = self._solver.step
        adaptive = max(FIXED['dop853'] / h, evaluations)
        found = [
            (stages / h, dataclasses.replace(self._solver, integrator=integrator))
            for integrator, stages in FIXED.items()
            if stages / h <= adaptive
        ]
        if not self._explicit:
            found += self._implicit(fine, adaptive)
        for _, solver in sorted(found, key=lambda each: each[0]):
            yield solver
        for _ in range(RETRIES):
            yield self._adaptive(tolerance)
            tolerance = max(0.1 * tolerance, FINEST)

    def _tolerance(self, fine: float) -> tuple[float, float]:
        """The largest tolerance below which all keep to the accuracy, and its evaluations/s."""
        tolerance, evaluations = 10.0 * fine, 0.0
        while True:
            simulation = self._made(self._adaptive(tolerance, coarse=True))
            path = self._advanced(simulation)
            good = self._good(self._distance(path) + self._own)
            if good or evaluations == 0.0:
                evaluations = simulation.evaluations / max(simulation.t, self._spacing)
            if not good:
                return max(tolerance / DECADE, fine), evaluations
            if tolerance * DECADE > LOOSEST:
                return tolerance, evaluations
            tolerance *= DECADE

    def _implicit(self, fine: float, most: float) -> Iterator[tuple[float, Solver]]:
        """The implicit integrator, if effects may be stiff, with the largest tolerance that keeps
        to the accuracy; None if that needs more than `most` evaluations/s."""
        tolerance = LOOSEST
        while tolerance >= fine:
            solver = self._adaptive(tolerance, coarse=True, integrator=IMPLICIT)
            simulation = self._made(solver)
            if not simulation.yields:
                return
            good = self._good(self._distance(self._advanced(simulation)) + self._own)
            evaluations = DEAR * simulation.evaluations / max(simulation.t, self._spacing)
            if evaluations > most:
                return
            if good:
                yield evaluations, self._adaptive(tolerance, integrator=IMPLICIT)
                return
            tolerance /= DECADE

    def _judged(self, solver: Solver) -> Budget:
        estimate = self._distance(self._path(solver)) + self._own
        return Budget(solver, self._accuracy, estimate, self._instants * self._spacing)

    def _good(self, estimate: float) -> bool:
        return MARGIN * estimate <= self._accuracy

    def _adaptive(
        self, tolerance: float, coarse: bool = False, integrator: str = 'dop853_adaptive'
    ) -> Solver:
        """On the grid of the instants if `coarse`: there the tolerance alone sets the steps."""
        step = self._spacing if coarse else self._solver.step
        return dataclasses.replace(
            self._solver, integrator=integrator, tolerance=tolerance, step=step
        )

    def _path(self, solver: Solver) -> Floats:
        return self._advanced(self._made(solver))

    def _advanced(self, simulation: Trial) -> Floats:
        """(instants, places, D): where the blocks are at each instant, as far as it comes."""
        steps = round(self._spacing / simulation.h)
        places: list[Floats] = []
        self._starved = False  # whether it ended because no step was small enough
        try:
            while len(places) < self._instants and simulation.evaluations <= self._most:
                simulation.step(steps)
                places.append(simulation.state.q.reshape(-1, self._dimension))
        except StepError as error:
            self._starved = error.reason == Status.COLLAPSED.reason
        return np.array(places)

    def _distance(self, path: Floats) -> float:
        """The largest from the best run, m; infinite if it did not come as far."""
        n = self._instants
        if n == 0 or len(path) < n:
            return math.inf
        return float(np.linalg.norm(path[:n] - self._best[:n], axis=2).max())

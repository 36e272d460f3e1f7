"""A trial: one run of a scene, measured against the exact motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.errors import AlfError
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.exact import one_freedom
from alf_ros.studies.exact.cost import Cost, evaluations_for
from alf_ros.studies.exact.motions import ExactMotion

LARGEST_GAP = 1e-12  # m, of a constraint


@dataclass(frozen=True)
class RunSpec:
    """A motion, computed with the step `h` (s), or with `tolerance` on a grid of `h`.

    `bound` (m) is on its position error. `penalty`: in place of the penalty of the scene.
    `reduced`: the cost of the equation of the one freedom alone, by tolerance, for comparison.
    """

    motion: ExactMotion
    integrator: str
    h: float
    bound: float
    tolerance: float | None = None
    penalty: float | None = None
    reduced: Callable[[], Sequence[Cost]] | None = None

    @property
    def effort(self) -> str:
        """The setting of the accuracy, in words."""
        if self.tolerance is not None:
            return f'tolerance {self.tolerance:.0e}'
        return f'h = {1e3 * self.h:.4g} ms'


@dataclass(frozen=True)
class RunResult:
    """Largest errors of a run; NaN, and the reason in `failure`, if it did not come to its end."""

    run: RunSpec
    position: float
    energy: float
    constraint: float
    energy_bound: float
    failure: str
    evaluations: int = 0

    @property
    def ratio(self) -> float:
        """Evaluations over those that the one freedom alone needs for the same position error.

        NaN where nothing was asked for, or the run did not come to its end.
        """
        if self.run.reduced is None or self.failure:
            return math.nan
        return self.evaluations / evaluations_for(self.position, self.run.reduced())

    @property
    def verdict(self) -> str:
        """'passed', the failure, or the errors above their bounds, in words."""
        if self.failure:
            return self.failure
        errors = {
            'position': (self.position, self.run.bound),
            'energy': (self.energy, self.energy_bound),
            'constraint': (self.constraint, LARGEST_GAP),
        }
        above = [name for name, (error, bound) in errors.items() if not error < bound]
        return f'{" and ".join(above)} error above the bound' if above else 'passed'


@dataclass(frozen=True)
class TableRow:
    """A line of the table: runs of one mechanism; `order` is the lowest acceptable one, `ratio`
    the highest median of the evaluations over the evaluations of the one freedom alone.
    """

    case: str
    setting: str
    runs: tuple[RunSpec, ...]
    order: float | None = None
    ratio: float | None = None


def execute(run: RunSpec) -> RunResult:
    """One run, and its largest errors at the times of its motion."""
    position = energy = constraint = 0.0
    bound = math.nan
    try:
        options: dict[str, object] = {'integrator': run.integrator, 'step': run.h}
        options |= {'tolerance': run.tolerance, 'penalty': run.penalty}
        sim = Simulation(run.motion.scene(), **options)  # type: ignore[arg-type]
        # the energy that the whole mechanism gains by falling through the bound on the position
        mass = sum(body.mass for body in sim.scene.mechanism.bodies)
        bound = one_freedom.GRAVITY * mass * run.bound
        first, *_ = samples = list(sim.run(run.motion.times[-1], at=run.motion.times))
        for sample, q in zip(samples, run.motion.exact(), strict=True):
            position = _larger(position, np.abs(sample.q - q).max())
            if not run.motion.driven:
                energy = _larger(energy, abs(sample.energy - first.energy))
            constraint = _larger(constraint, sample.diagnostics.position_violation)
    except AlfError as error:
        return RunResult(run, math.nan, math.nan, math.nan, bound, str(error))
    return RunResult(run, position, energy, constraint, bound, '', sim.evaluations)


def _larger(a: float, b: float) -> float:
    """The larger of two errors; NaN, which no bound accepts, if one of them is: `max` drops it."""
    return float(np.maximum(a, b))


def observed_order(results: Iterable[RunResult]) -> float:
    """Slope of log error over log step; NaN where the errors do not lie along one.

    That is: fewer than four steps, less than two decades, or a correlation below 0.9. Only errors
    above the rounding of a pass (1e-9 m) and below 1 cm count.
    """
    points = [(r.run.h, r.position) for r in results if 1e-9 < r.position < 1e-2]
    if len({h for h, _ in points}) < 4:
        return math.nan
    steps, errors = np.log(np.array(points)).T
    if np.ptp(errors) < math.log(100) or np.corrcoef(steps, errors)[0, 1] < 0.9:
        return math.nan
    return float(np.polyfit(steps, errors, 1)[0])

"""One point of a work-precision chart: a setting, its cost, and its errors."""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.errors import AlfError, StepError
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.scene.scene import Scene
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.work_precision.reference import SPACING, Reference, course

STEPS = {  # s, of fixed steps
    'rk4': tuple(0.02 / 2**k for k in range(7)),
    'dop853': tuple(0.04 / 2**k for k in range(6)),
    'esdirk43': tuple(0.02 / 2**k for k in range(6)),
}
FEWEST, MOST = 3, 9  # repetitions
ENOUGH = 0.15  # s of repetitions after which there are no more than the fewest


@dataclass(frozen=True)
class Setting:
    """How a scene is computed. tolerance: of an adaptive integrator, whose `step` is its grid."""

    formulation: str
    integrator: str
    iterations: int
    step: float
    tolerance: float | None = None

    @property
    def curve(self) -> tuple[str, str, int]:
        """The common part of settings that differ in accuracy alone."""
        return self.formulation, self.integrator, self.iterations

    @property
    def effort(self) -> float:
        """Step (s) or tolerance: the smaller, the more accurate."""
        return self.step if self.tolerance is None else self.tolerance

    def __str__(self) -> str:
        if self.tolerance is not None:
            return f'{self.integrator}, tolerance {self.tolerance:.0e}'
        return f'{self.integrator}, step {1e3 * self.step:.3g} ms'


@dataclass(frozen=True)
class Measurement:
    """A measured setting.

    cpu: ms per simulated second, median of `repetitions`; preparation: s until the first step was
    done, compilation with it; evaluations: per simulated second. Largest errors at the instants of
    the reference: position (m), energy (J), gap of a constraint (m), Φ_qᵀ λ (N); NaN, and the
    reason in `failure`, if it did not come to its end.
    """

    setting: Setting
    cpu: float
    repetitions: int
    preparation: float
    evaluations: float
    position: float
    energy: float
    gap: float
    force: float
    failure: str = ''


def settings(
    formulations: Sequence[str],
    integrators: Sequence[str],
    iterations: Sequence[int],
    steps: Sequence[float] | None,
    tolerances: Sequence[float],
) -> Iterator[Setting]:
    """Every combination that means something; `steps` (s) are STEPS if not given.

    Formulations other than alf2 take fixed explicit steps only. Those that do not iterate are run
    with the last of `iterations` alone; with one iteration alf1 is penalty, and alf2_as_printed
    canonical.
    """
    for formulation in formulations:
        counts = iterations if formulation == 'alf2' else iterations[-1:]
        if formulation in ('alf1', 'alf2_as_printed'):
            counts = [count for count in iterations if count > 1]
        for integrator in integrators:
            adaptive = bool(TABLEAUX[integrator].embedded.size)
            if (adaptive or TABLEAUX[integrator].implicit) and formulation != 'alf2':
                continue
            for count in counts:
                for effort in tolerances if adaptive else steps or STEPS[integrator]:
                    setting = Setting(formulation, integrator, count, effort)
                    if adaptive:
                        setting = dataclasses.replace(setting, step=SPACING, tolerance=effort)
                    yield setting


def measure(scene: Scene, setting: Setting, against: Reference) -> Measurement:
    """Run it for its errors, then again and again for its time."""
    started = time.perf_counter()
    duration = against.times[-1]
    try:
        simulation = Simulation(scene, **dataclasses.asdict(setting))
        simulation.step(1)
    except StepError as error:
        return _failed(scene, setting, error, duration)
    except AlfError as error:  # a formulation that this scene is too much for
        nothing = (math.nan,) * 6
        return Measurement(setting, math.nan, 0, *nothing, str(error).partition('\n')[0])
    preparation = time.perf_counter() - started
    try:
        found = course(simulation, against.times)
    except StepError as error:
        point = _failed(scene, setting, error, duration)
        return dataclasses.replace(point, preparation=preparation)
    wanted = against.course
    errors = (
        float(np.abs(found.q - wanted.q).max()),
        float(np.abs(found.energy - wanted.energy).max()),
        found.gap,
        float(np.abs(found.force - wanted.force).max()),
    )
    steps = math.floor(duration / simulation.h + 1e-6)
    simulation.reset()
    before = simulation.evaluations
    times = [_timed(simulation, steps)]
    evaluations = (simulation.evaluations - before) / (steps * simulation.h)
    while len(times) < FEWEST or (len(times) < MOST and sum(times) < ENOUGH):
        simulation.reset()
        times.append(_timed(simulation, steps))
    cpu = 1e3 * statistics.median(times) / (steps * simulation.h)
    return Measurement(setting, cpu, len(times), preparation, evaluations, *errors)


def _timed(simulation: Simulation, steps: int) -> float:
    """Seconds of this thread; what else runs on the machine is not counted."""
    started = time.thread_time()
    simulation.step(steps)
    return time.thread_time() - started


def _failed(scene: Scene, setting: Setting, error: StepError, duration: float) -> Measurement:
    """The cost of the run as far as it came."""
    simulation = Simulation(scene, **dataclasses.asdict(setting))
    spent = []
    for _ in range(FEWEST):
        simulation.reset()
        started = time.thread_time()
        try:
            simulation.step(math.floor(duration / simulation.h + 1e-6))
        except StepError:
            pass
        spent.append(time.thread_time() - started)
    cpu = 1e3 * statistics.median(spent) / ((simulation.step_index + 1) * simulation.h)
    nothing = (math.nan,) * 6
    text = f'stopped at {error.t:.3g} s: {error.reason}'
    return Measurement(setting, cpu, FEWEST, *nothing, text)

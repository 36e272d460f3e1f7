"""The setting in which Bayo & Avello ran their examples: a variable-step multistep method.

They give a tolerance of 1e-5 and α = 1e7, here the same for every row. We do not know which code
they used. The usual one of the time is the code of Shampine & Gordon, which SciPy does not have:
`formulations/adams.py`. VODE of SciPy is the alternative. It repeats the corrector until
convergence, with shorter steps beside a singular position and nearer evaluations.

The integrators drive the rates of a formulation from outside the compiled step, and take the
examples only: nothing is counted, prescribed or watched on the way.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import ode

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import StepError
from alf_ros.model import assembly
from alf_ros.model.compile import Model, allocate, compile_model
from alf_ros.scene.scene import Scene, Solver
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.formulations import Formulation
from alf_ros.simulation.formulations.adams import Adams
from alf_ros.simulation.input_values import NO_INPUTS
from alf_ros.simulation.reactions import Reactions

MOST = 20_000  # evaluations: more than ten times what a run takes that comes through
Rates = Callable[[float, Floats], Floats]


@dataclass(frozen=True)
class PublishedSetting:
    """tolerance: relative to 1 + |y|, of a step. penalty: α of every row."""

    tolerance: float = 1e-5
    penalty: float = 1e7
    integrator: str = 'adams'


def _adams(rates: Rates, y: Floats, tolerance: float, times: Floats) -> Iterator[Floats]:
    """y (size,) at each of `times` (s)."""
    motion = Adams(rates, y, tolerance)
    for t in times:
        while motion.t < t:
            motion.step()
        yield motion.at(t)


def _vode(rates: Rates, y: Floats, tolerance: float, times: Floats) -> Iterator[Floats]:
    """The same with the variable-order Adams's method of VODE."""
    failed: list[StepError] = []

    def told(t: float, y: Floats) -> Floats:
        try:
            return rates(t, y)
        except StepError as error:  # scipy from 1.18 on hands no exception on
            failed.append(error)
            return np.full_like(y, np.nan)

    solver = ode(told).set_integrator(
        'vode', method='adams', rtol=tolerance, atol=tolerance, nsteps=MOST
    )
    solver.set_initial_value(y, 0.0)
    yield y
    for last, t in zip(times, times[1:], strict=False):
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', UserWarning)  # told below
            y = solver.integrate(t)
        if failed:
            raise failed[0]
        if not solver.successful():
            raise StepError('VODE finds no step', 'use a larger tolerance', float(last))
        yield y


INTEGRATORS = {'adams': _adams, 'vode': _vode}


class PublishedRun:
    """A run of a scene with `alf1` or `alf2_as_printed` in the setting of the paper."""

    def __init__(self, scene: Scene, formulation: str, setting: PublishedSetting) -> None:
        model = compile_model(scene.mechanism, Solver().penalty)
        self._q = assembly.close(model, scene.positions)
        self._qd = assembly.complete(model, self._q, scene.velocities)
        rows = model.system.rows
        rows = replace(rows, alpha=np.full_like(rows.alpha, setting.penalty))
        self.model: Model = replace(model, system=replace(model.system, rows=rows))
        self.evaluated: list[
            tuple[float, Floats]
        ] = []  # t (s) and q (n,) in the order of the file
        self._setting = setting
        self._formulation = Formulation(self.model, Solver(formulation=formulation), self._q)
        applied = Applied(self.model, scene.effects, NO_INPUTS, lambda: Reactions(self.model))
        self._forces = applied.assembled
        self._work = allocate(self.model, self.model.system, 1)

    def states(self, times: Floats) -> Iterator[tuple[Floats, Floats]]:
        """q (m) and q̇ (m/s), all blocks D, at each of `times` (s), the first of which is 0.

        Raises StepError where the run ends early.
        """
        y = self._formulation.start(self._q, self._qd)
        self._work.q[:], self._work.qd[:] = self._q, self._qd
        integrate = INTEGRATORS[self._setting.integrator]
        motion = integrate(self._counted, y, self._setting.tolerance, times)
        for t, found in zip(times, motion, strict=True):
            self._rates(t, found)  # leaves q and q̇ in `work`
            yield self._work.q.copy(), self._work.qd.copy()

    def _counted(self, t: float, y: Floats) -> Floats:
        if len(self.evaluated) == MOST:
            raise StepError(f'it needs more than {MOST} evaluations', 'the motion has failed', t)
        rates = self._rates(t, y)
        blocks = self.model.coordinate_block
        q = self._work.q.reshape(-1, self.model.layout.dimension)[blocks].ravel()
        self.evaluated.append((t, q))
        return rates

    def _rates(self, t: float, y: Floats) -> Floats:
        result, rates = self._formulation.rates(self._forces, self._work, t, y)
        if result != kernel.Status.OK or not np.isfinite(rates).all():
            raise StepError('the state is no longer finite', 'the motion has failed', t)
        return rates

"""The run of a simulation: its present, stepped, with the passes, samples and tangents on the way.

It checks no thread: that is for its simulation.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

from alf_ros.errors import InputError
from alf_ros.kernel import Phase, Status, Watch
from alf_ros.scene.scene import Solver
from alf_ros.simulation import input_checks as check
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.between import Between
from alf_ros.simulation.input_values import Inputs
from alf_ros.simulation.lasting_tangents import LastingTangents
from alf_ros.simulation.present import Present
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.singular_passes import Pass, Watcher
from alf_ros.simulation.start import Start
from alf_ros.simulation.state import State
from alf_ros.simulation.state_trail import StateTrail
from alf_ros.simulation.step_failures import failure
from alf_ros.simulation.stepping import Stepper


class SteppedRun:
    """Steps from a state on, with one start, one solver and one stepper.

    `present` is replaced whenever more changes than steps do. `step_cost`: s, of the last steps.
    """

    def __init__(
        self,
        start: Start,
        solver: Solver,
        stepper: Stepper,
        state: State,
        accounts: tuple[str, ...],
        tangents: LastingTangents | None = None,
    ) -> None:
        self.stepper, self.tangents = stepper, tangents
        self.present = Present.at(start, state, stepper.applied, accounts, stepper.h)
        stepper.begin(self.present)
        self.step_cost = math.nan
        self._start, self._solver = start, solver
        self._watcher: Watcher | None = None
        self._between = Between(stepper)

    # ----------------------------------------------------------------------------------- present

    @property
    def t(self) -> float:
        """Simulated time, s."""
        return self.present.step * self.stepper.h

    @property
    def applied(self) -> Applied:
        """The forces now."""
        return self.present.applied

    def enter(self, state: State) -> None:
        """Continue from a usable state; uses the packed forces."""
        h = self.stepper.h
        present = Present.at(self._start, state, self.applied, self.present.accounts, h)
        self.stepper.begin(present)
        if self.tangents is not None:
            self.tangents.restart(state.step * h)
        if self._watcher is not None:
            self._watcher.restart()
        self.present = present

    def hold(self, inputs: Inputs) -> None:
        """Raises InputError, and changes nothing, for what cannot be packed."""
        if inputs != self.applied.inputs:
            if self.tangents is not None:
                self.tangents.following.places.check(inputs)
            self.present = replace(self.present, applied=self.applied.holding(inputs))

    @property
    def memory(self) -> dict[str, Any]:
        """All of it but start and settings, as a copy needs it to continue."""
        return {
            'state': self.present.state(),
            'since': self.present.since,
            'departures': self.present.model.system.departures,
            'within': self.present.phase.within.copy(),
            'steps': self.stepper.memory,
            'step_cost': self.step_cost,
            'tangents': self.tangents.memory if self.tangents else None,
            'watcher': self._watcher.memory if self._watcher else None,
        }

    def recall(self, memory: dict[str, Any]) -> None:
        """Continue from the memory of another, in whose state this one begins."""
        model = self._start.model.leaving(memory['departures'])
        self.present = replace(self.present, model=model, since=memory['since'])
        self.present.phase.within[:] = memory['within']
        self.stepper.recall(memory['steps'])
        self.step_cost = memory['step_cost']
        if self.tangents is not None:
            self.tangents.recall(memory['tangents'])
        if memory['watcher'] is not None:
            self.watch().recall(memory['watcher'])

    # ------------------------------------------------------------------------------------- steps

    def advance(self, n: int) -> None:
        """n steps. Raises StepError if one fails, and what stops it, at the last whole step."""
        started, present = time.perf_counter(), self.present
        first = present.step
        n = check.whole(n, 'n', 0, check.MOST_STEPS - first)
        if self._watcher is None:
            status = self.stepper.advance(present, n)
        else:
            status = self._watcher.step(present.phase, n)
        if present.step > first:
            self.step_cost = (time.perf_counter() - started) / (present.step - first)
        if status != Status.OK:
            raise failure(self.stepper, status, present)

    def advance_along(self, n: int, trail: StateTrail) -> None:
        """n steps, with the states on the way. Raises as `advance` does."""
        self.stepper.trail = trail.trail
        try:
            self.advance(n)
        finally:
            self.stepper.trail = None

    # ------------------------------------------------------------------------ singular positions

    @property
    def is_watched(self) -> bool:
        """Whether passes through singular positions are found."""
        return self._watcher is not None

    def watch(self) -> Watcher:
        """Find the passes from here on. Raises InputError for another formulation than alf2."""
        if self.stepper.formulation is not None:
            raise InputError(
                'only alf2 watches for singular positions',
                key='formulation',
                value=self._solver.formulation,
            )
        self._watcher = Watcher(
            self._start.model,
            self._start.dependent_rows,
            self._start.ordinary,
            self.stepper.h,
            self._advance_watched,
            self._step_aside,
            self._energy,
        )
        return self._watcher

    def _advance_watched(self, n: int, watch: Watch | None) -> Status:
        return self.stepper.advance(self.present, n, watch)

    def _step_aside(self, phase: Phase, start: float, h: float) -> Status:
        present = replace(self.present, phase=phase)
        return self.stepper.aside(present, start, h, counted=False)

    def _energy(self, t: float, phase: Phase) -> float:
        return self.sample_of(t, replace(self.present, phase=phase).state(), False).energy

    def passes(self) -> tuple[Pass, ...]:
        """Since the run was set to a state. Raises InputError if it is not watched."""
        if self._watcher is None:
            raise InputError('nobody watches', key='passes', expected='Simulation(…, watch=True)')
        self._watcher.finish()
        return tuple(self._watcher.passes)

    # ----------------------------------------------------------------------------------- samples

    def sample(self) -> Sample:
        """Of the present state."""
        return self.sample_of(self.t, self.present.state(), self.stepper.beside(self.present))

    def sample_between(self, t: float) -> Sample:
        """Of the motion at t (s), between two grid points. Raises StepError."""
        return self.sample_of(t, *self._between.at(self.present, t), whole=False)

    def sample_of(self, t: float, state: State, beside: bool | None, whole: bool = True) -> Sample:
        """`beside`: whether the step that ended there was interpolated beside a singular position;
        None if no step did; `whole`: whether it is at the end of a whole step."""
        stepper, tangents = self.stepper, self.tangents
        passes = self._watcher.passes if self._watcher else ()
        return Sample(
            self.present.model,
            self.applied,
            self._solver,
            t,
            state,
            self._start.dependent_rows,
            stepper.instruments,
            stepper.iterations,
            self.step_cost,
            False if stepper.formulation else beside,
            stepper.resolution_later(),
            None if tangents is None else tangents.followed(passes, whole),
        )

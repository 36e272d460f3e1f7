"""The motion at an instant between two steps, reached aside: the run does not change."""

from __future__ import annotations

import math
from dataclasses import replace

from alf_ros.arrays import Floats
from alf_ros.kernel import Status
from alf_ros.simulation.present import Present
from alf_ros.simulation.state import State
from alf_ros.simulation.step_failures import failure
from alf_ros.simulation.stepping import Stepper


class Between:
    """Goes from the last grid point of a run to instants behind it.

    A method of fixed steps takes one step from the grid point. An adaptive method continues from
    the last instant that was asked for: otherwise each instant would cost all steps since the grid
    point.
    """

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        # grid point it was reached from, t (s), state, whether beside a singular position, and
        # `Phase.within` of the last instant
        self._last: tuple[tuple[Present, int], float, State, bool | None, Floats] | None = None

    def at(self, present: Present, t: float) -> tuple[State, bool | None]:
        """The state at t (s), and whether it was interpolated beside a singular position.

        Raises StepError, and what stops a step.
        """
        stepper, here = self._stepper, (present, present.step)
        start, state, beside = present.step * stepper.h, present.state(), stepper.beside(present)
        within = present.phase.within
        if self._last is not None and stepper.method.embedded.size:
            of, last, *_ = self._last
            if of[0] is present and of[1] == present.step and last <= t:
                _, start, state, beside, within = self._last
        if t > start:
            aside = present.aside(state, within)
            status = stepper.aside(aside, start, t - start)
            if status != Status.OK:
                raise failure(stepper, status, present)
            state = replace(aside.state(), step=state.step, h=math.nan)
            beside = stepper.beside_aside()
            self._last = here, t, state, beside, aside.phase.within
        return state, beside

"""The present of a run: the arrays that compiled code steps, and the forces on them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel import Phase
from alf_ros.model.compile import Model
from alf_ros.model.prescribed import prescribe
from alf_ros.model.singular_start import departing
from alf_ros.simulation.applied import Applied
from alf_ros.simulation.integral_sums import sums_of
from alf_ros.simulation.start import Rest, Start, rest_at
from alf_ros.simulation.state import State


@dataclass(frozen=True, eq=False)
class Present:
    """The present state of a run.

    `phase` and `carried` (the variables of a formulation other than alf2) are written by the
    steps, with the number of steps. Every other change of the run makes another `Present`, so that
    one assignment changes all of it: an exception, even from a signal, comes before or after.
    `since`: the step at which the run was set to a state, before the first it has made. `h`: the
    length of a step, s. `rest`: where the run was set at rest near a singular position; `model`:
    the mechanism, which knows how it may leave that, else where the scene starts.
    """

    model: Model
    rest: Rest | None
    phase: Phase
    carried: Floats
    applied: Applied
    accounts: tuple[str, ...]
    since: int
    h: float

    @classmethod
    def at(
        cls, start: Start, state: State, applied: Applied, accounts: tuple[str, ...], h: float
    ) -> Present:
        """The present at a state of the motion from a start, with steps of h (s)."""
        if state.inputs != applied.inputs:
            applied = applied.holding(state.inputs)
        # the rank is counted before the next step, but at an ordinary start
        begins = not (state.step or start.near) and np.array_equal(state.q, start.q)
        within = np.array([0.0 if begins else math.nan])
        state = replace(state, sums=sums_of(start.model, state))
        phase = _phase(state, accounts, applied.load_count, within)
        # a state may come from a log, which holds what moves freely
        prescribe(start.model.system, state.step * h, phase.q, phase.qd, np.zeros_like(phase.q))
        rest = rest_at(start, phase.q, phase.qd, state.step * h, h)
        model = start.model if rest is None else departing(start.model, rest.position)
        return cls(model, rest, phase, state.carried.copy(), applied, accounts, state.step, h)

    def aside(self, state: State, within: Floats) -> Present:
        """Another one, at a state between two steps; `within` as in its phase."""
        phase = _phase(state, self.accounts, self.phase.loads.size, within)
        return replace(self, phase=phase, carried=state.carried.copy())

    @property
    def step(self) -> int:
        """Number of steps taken."""
        return int(self.phase.step[0])

    def state(self) -> State:
        """A copy of the state."""
        of = self.phase
        return State(
            self.step,
            of.q.copy(),
            of.qd.copy(),
            of.turns.copy(),
            float(of.pace[0]),
            self.carried.copy(),
            self.applied.inputs,
            dict(zip(self.accounts, of.works.tolist(), strict=True)),
            of.loads.copy(),
            of.tangents.copy(),
            of.sums.copy(),
            self.h,
        )


def _phase(state: State, accounts: tuple[str, ...], loads: int, within: Floats) -> Phase:
    """The phase of a state, in arrays of its own.

    Works that the state does not know begin at zero, loads with the balance that friction leads to
    as it is put on.
    """
    known = state.loads if state.loads.size == loads else np.zeros(loads)
    return Phase(
        state.q.copy(),
        state.qd.copy(),
        state.turns.copy(),
        np.array([state.pace]),
        np.array([state.works.get(name, 0.0) for name in accounts]),
        known.copy(),
        within.copy(),
        np.array([state.step]),
        state.sums.copy(),
        state.tangents.copy(),
    )

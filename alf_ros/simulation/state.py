"""The state from which a run continues."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.errors import InputError
from alf_ros.simulation.input_values import Inputs


@dataclass(frozen=True)
class State:
    """Everything a run depends on: restore it and the run repeats bit for bit.

    q (m), qd (m/s): all blocks in the kernel's order; turns: of each angle; pace: the next step of
    an adaptive integrator, s; carried: the variables of a formulation other than alf2; works (J):
    of each account, if a ledger is kept; loads (N): the last reaction on which each effect with
    friction depends, then the sense of their balance, 1 or -1; zero if unknown; tangents (K 2
    blocks D): the derivatives of q and q̇ by each of K numbers of the scene, if they are followed;
    sums (m): of angles and lengths, which gears, racks, threads, wheels on a line and couplings
    keep constant; empty: what they are at q; h (s): the length of the steps that `step` counts; 0:
    any run takes it as its own; NaN: the state lies between two steps.
    """

    step: int
    q: Floats
    qd: Floats
    turns: Integers
    pace: float
    carried: Floats
    inputs: Inputs
    works: Mapping[str, float] = field(default_factory=dict)
    loads: Floats = field(default_factory=lambda: np.zeros(0))
    tangents: Floats = field(default_factory=lambda: np.zeros(0))
    sums: Floats = field(default_factory=lambda: np.zeros(0))
    h: float = 0.0

    def __repr__(self) -> str:
        return f'<State at step {self.step}, {self.q.size} coordinates>'

    def moved(self, q: Floats, qd: Floats, turns: Integers) -> State:
        """The same at another place (blocks D, m, m/s), where gears and the like now mesh."""
        return replace(self, q=q, qd=qd, turns=turns, sums=np.zeros(0))

    def counted(self, h: float) -> State:
        """The same instant for steps of h (s): time is counted in steps. Raises InputError if it
        is not a whole number of them."""
        if self.h in (0.0, h):
            return replace(self, h=h)
        steps = self.step * self.h / h
        if abs(steps - round(steps)) > 1e-6:
            raise InputError(
                f't = {self.step * self.h:.9g} s is not a whole number of such steps: reset first',
                key='solver.step',
                value=h,
            )
        return replace(self, step=round(steps), pace=h, h=h)

"""What a run goes on from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.simulation.applied import Inputs


@dataclass(frozen=True)
class State:
    """Everything a run depends on: restore it and the run repeats bit for bit.

    q (m), qd (m/s): all blocks in the kernel's order; turns: of each angle; pace: the step an
    adaptive integrator would like to take next, s; carried: what a formulation other than alf2
    integrates; works (J): of each account, if a ledger is kept; loads (N): the
    reaction that each effect with friction depends on, as found last; zero where none is known.
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

"""The sums of angles and lengths that gears, racks, threads, wheels on a line and couplings keep
constant, of a state."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.compile import Model, allocate
from alf_ros.simulation.state import State


def sums_of(model: Model, state: State) -> Floats:
    """(integrals,) m: the sums in the state, or if it has none their values at its q."""
    system, count = model.system, model.system.integrals.row.size
    if state.sums.size == count:
        return state.sums
    sums, work = np.zeros(count), allocate(model, system, 0)
    kernel.integral_values(model.unit, system, work, state.q, state.turns, sums)
    return sums

"""The sums of angles and lengths that gears, racks, threads, wheels on a line and couplings keep
constant, of a state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.compile import Model, allocate, hold
from alf_ros.simulation.state import State


def sums_of(model: Model, state: State) -> Floats:
    """(integrals,) m: the sums in the state, or if it has none their values at its q."""
    system, count = model.system, model.system.integrals.row.size
    if state.sums.size == count:
        return state.sums
    sums, work = np.zeros(count), allocate(model, system, 0)
    kernel.integral_values(model.unit, system, work, state.q, state.turns, sums)
    return sums


def integral_names(model: Model) -> list[str]:
    """The joints and couplings whose sums these are, in their order."""
    _, names, _ = hold(model, [], velocities=True)
    first = len(names) - model.system.rows.velocity
    return [names[first + int(row)] for row in model.system.integrals.row]


def with_couplings_of(model: Model, state: State, drawn: State) -> State:
    """The state with the sums of couplings that another one of the same model has."""
    couplings = {coupling.name for coupling in model.mechanism.couplings}
    own = [name in couplings for name in integral_names(model)]
    return replace(state, sums=np.where(own, sums_of(model, drawn), sums_of(model, state)))


def couplings_off(model: Model, state: State) -> dict[str, float]:
    """By how much each coupling misses its sum in the state, at its q, m, by name."""
    missed = sums_of(model, replace(state, sums=np.zeros(0))) - state.sums
    couplings = {coupling.name for coupling in model.mechanism.couplings}
    pairs = zip(integral_names(model), missed.tolist(), strict=True)
    return {name: off for name, off in pairs if name in couplings}

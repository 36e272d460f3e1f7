"""What the effects of a simulation cost in a step, measured without Python around them."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from alf_ros import kernel
from alf_ros.kernel import Effects
from alf_ros.simulation.simulation import Simulation

_CALLS = 1000  # in one compiled call: what that costs itself is then a nanosecond of each
_ROUNDS = 5  # of which the quickest counts


def call_costs(simulation: Simulation) -> dict[str, float]:
    """µs per step of each effect, as it stands now: one evaluation per stage of the method.

    What friction under a true load costs besides, the search for the load, is not in it.
    """
    state, stages = simulation.state, simulation.stages
    near, loads = simulation.sample()._near, np.ones(1)  # N
    costs = {}
    for label, part in simulation._applied.each.items():
        many = _repeated(part.effects)
        Q = np.zeros(state.q.size)
        least = math.inf
        for _ in range(_ROUNDS):
            started = time.perf_counter()
            kernel.applied_forces(many, simulation.t, state.q, state.qd, near, Q)
            if part.loads:
                kernel.add_friction(many, simulation.t, state.q, state.qd, near, loads, Q)
            least = min(least, time.perf_counter() - started)
        costs[label] = 1e6 * least / _CALLS * stages
    return costs


def _repeated(effects: Effects) -> Effects:
    """One effect, many times."""
    names = ('force', 'potential', 'friction', 'slots_at', 'params_at', 'loads_at')
    return replace(effects, **{name: np.repeat(getattr(effects, name), _CALLS) for name in names})

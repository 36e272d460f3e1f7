"""What a sample in a singular position is read from: the places around it.

Compiled only for a sample that is in one.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.data import Forces, Phase, System, Work
from alf_ros.kernel.interpolated_stages import evaluate_aside, evaluate_place
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.step import evaluate_first, nearness

# Forces are read here, and where all that moves is driven they are off by rounding over x⁴: the
# places are four times as far away as those of a stage.
_APART = 1.2


@compiled
def find_places(
    unit: Unit, system: System, forces: Forces, work: Work, phase: Phase, t: float, iterations: int
) -> bool:
    """Leave the places around `phase`, and the forces that act there, in `work`.

    False where there are none: at a standstill that knows no direction, or where friction jams.
    """
    copy(phase.q, work.q)
    copy(phase.qd, work.qd)
    prescribe(system, t, work.q, work.qd, work.qdd)
    work.places[0] = np.inf  # until places are found
    if not linearise(unit, system, work, work.q):
        return False
    count, _sigma = evaluate_first(unit, system, forces, work, phase, t, iterations)
    if count < 0:
        return False
    radius, close, falling = nearness(system, work, phase)
    copy(phase.q, work.base)
    copy(phase.qd, work.along)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, phase.qd, work.p)
    s = np.uint64(0)
    apart = _APART * system.close * radius
    count = evaluate_aside(
        unit, system, forces, work, phase, t, s, apart, radius, close, falling, iterations
    )
    return count > 0 and work.places[0] < np.inf


@compiled
def evaluate_at_place(
    unit: Unit, system: System, forces: Forces, work: Work, t: float, k: int, iterations: int
) -> bool:
    """q̈ and λ at place k of 8, with Φ_q and factor, under the forces of the sample."""
    return evaluate_place(unit, system, forces, work, t, k, iterations) > 0

"""The places around a singular position, from which a sample in it is interpolated.

Compiled only for a sample that is in one.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.departure import rests_apart, speed_of
from alf_ros.kernel.interpolated_stages import evaluate_interpolated, evaluate_place
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.slip import begin_slips
from alf_ros.kernel.step import curve_path, evaluate_first

# Forces are read here, and where all that moves is driven they are off by rounding over x⁴: the
# support positions are four times as far away as for a stage.
_APART = 1.2


@compiled
def find_places(problem: Problem, phase: Phase, t: float, part: float) -> bool:
    """Store the places around `phase`, a `part` of the usual way apart, and the forces that act
    there, in `work`.

    False where there are none: at a standstill without a direction, or where friction has no
    balance.
    """
    unit, system, work = problem.unit, problem.system, problem.work
    copy(phase.q, work.q)
    copy(phase.qd, work.qd)
    prescribe(system, t, work.q, work.qd, work.qdd)
    begin_slips(unit, system, work, phase)
    work.places[0] = np.inf  # until places are found
    if not linearise(unit, system, work, work.q):
        return False
    count, _sigma = evaluate_first(problem, phase, t)
    if count < 0:
        return False
    curve_path(problem)
    scales = scales_of(system, work, phase, False)
    copy(phase.q, work.base)
    copy(phase.qd, work.along)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, phase.qd, work.p)  # (30), σ = 0
    s = np.uint64(0)
    apart = part * _APART * system.close * scales.radius
    rests = rests_apart(system, phase.q)  # which no drive holds
    speed = speed_of(system, rests, phase.qd, work.p.size)
    if not speed > 0.0 and (rests or not system.prescribed.program.size):
        apart = 0.0  # the radius is not known from rest: as near as those of a stage
    count = evaluate_interpolated(problem, phase, t, s, apart, scales)
    return count > 0 and work.places[0] < np.inf


@compiled
def evaluate_at_place(problem: Problem, t: float, k: int) -> bool:
    """q̈ and λ at place k of 8, with Φ_q and factor, under the forces of the sample."""
    return evaluate_place(problem, t, k) > 0

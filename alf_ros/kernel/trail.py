"""States on the way of a run, written down as the steps are taken."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, Trail
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.vectors import copy


@inner
def leave_trail(trail: Trail, phase: Phase) -> None:
    """Write down the end of a step, if it is the next one that is asked for."""
    if trail.steps.size == 0:
        return
    k = np.uint64(trail.count[0])
    if k >= trail.steps.size or trail.steps[k] != phase.step[0]:
        return
    whole, followed, angles = phase.q.size, phase.tangents.size, phase.turns.size
    copy(phase.q, section(trail.q, k * whole, whole))
    copy(phase.qd, section(trail.qd, k * whole, whole))
    copy(phase.tangents, section(trail.tangents, k * followed, followed))
    for a in range(angles):
        trail.turns[k * angles + a] = phase.turns[a]
    trail.count[0] += 1

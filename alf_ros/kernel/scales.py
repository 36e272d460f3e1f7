"""Scales of the nearness to a singular position in a step: of the path, and of speeds."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, Scales, System, Work
from alf_ros.kernel.departure import speed_of
from alf_ros.kernel.numba_ext.jit import inner


@inner
def scales_of(system: System, work: Work, phase: Phase, apart: bool) -> Scales:
    """The scales in the step that begins at `phase`, of all or of the part alone that rests there
    (`apart`); behind `curve_path`."""
    n = work.p.size
    fastest = speed_of(system, apart, phase.qd, n)
    hardest = speed_of(system, apart, work.pull, n)
    bend = speed_of(system, apart, work.bend, n)
    radius, close = system.size, system.close
    if fastest * fastest < radius * bend:
        radius = fastest * fastest / bend
    # rounding acts as v² / x³: slow motions may come closer
    if fastest * fastest < radius * hardest:
        close *= (fastest * fastest / (radius * hardest)) ** (1.0 / 3.0)
    return Scales(radius, close, np.sqrt(hardest * system.size))

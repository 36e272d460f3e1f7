"""M v, with the constant mass matrix of natural coordinates."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Mass
from alf_ros.kernel.numba_ext.block import add, block
from alf_ros.kernel.numba_ext.jit import ONE, compiled, inner
from alf_ros.kernel.numba_ext.plain_loops import each


@compiled
def add_mass_times(unit: Unit, mass: Mass, s: float, v: Floats, out: Floats) -> None:
    """out += s M v on movable blocks."""
    for i in each(0, mass.diagonal.size):
        add(out, i, (s * mass.diagonal[i]) * block(unit, v, i))
    for n in each(0, mass.i.size):
        i, j, k = mass.i[n], mass.j[n], s * mass.k[n]
        add(out, i, k * block(unit, v, j))
        add(out, j, k * block(unit, v, i))
    add_skew_times(unit, mass, s, v, out)


@inner
def add_skew_times(unit: Unit, mass: Mass, s: float, v: Floats, out: Floats) -> None:
    """The skew part: out += s w J v of each pair."""
    D = np.uint64(len(unit))
    for n in each(0, mass.skew.size):
        i, j, w = mass.i[mass.skew[n]] * D, mass.j[mass.skew[n]] * D, s * mass.w[n]
        out[i] -= w * v[j + ONE]
        out[i + ONE] += w * v[j]
        out[j] += w * v[i + ONE]
        out[j + ONE] -= w * v[i]

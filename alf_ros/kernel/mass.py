"""M v, with the constant mass matrix of natural coordinates."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import ONE, Mass
from alf_ros.kernel.jit import compiled, inner


@compiled
def add_mass_times(unit: Unit, mass: Mass, s: float, v: Floats, out: Floats) -> None:
    """out += s M v on movable blocks."""
    D = np.uint64(len(unit))
    for i in range(mass.diagonal.size):
        k = s * mass.diagonal[i]
        for a in range(D):
            out[i * D + a] += k * v[i * D + a]
    _add_pairs(D, mass, s, v, out)
    add_skew_times(unit, mass, s, v, out)


@inner
def _add_pairs(D: np.uint64, mass: Mass, s: float, v: Floats, out: Floats) -> None:
    for n in range(mass.i.size):
        i, j, k = mass.i[n] * D, mass.j[n] * D, s * mass.k[n]
        for a in range(D):
            out[i + a] += k * v[j + a]
            out[j + a] += k * v[i + a]


@inner
def add_skew_times(unit: Unit, mass: Mass, s: float, v: Floats, out: Floats) -> None:
    """Of the same the part of the w."""
    D = np.uint64(len(unit))
    for n in range(mass.skew.size):
        i, j, w = mass.i[mass.skew[n]] * D, mass.j[mass.skew[n]] * D, s * mass.w[n]
        out[i] -= w * v[j + ONE]
        out[i + ONE] += w * v[j]
        out[j] += w * v[i + ONE]
        out[j + ONE] -= w * v[i]

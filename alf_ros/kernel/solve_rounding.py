"""The part of a free motion that rounding leaves in one solve with the factor of A.

A⁻¹ M leaves all of a free motion, and of a mode of the rows a part 1 / (1 + s²). The factor is
rounded by about ε of its largest numbers, which have the size of the penalty. To a light part,
such as a rod that spins, this is as if its mass were another one: A⁻¹ M v is not quite v. A solve
leaves that part of a motion for the next round.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import System, Work
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.triangular_solve import solve

ASIDE = 1e-3  # of the shortest distance: axes of a drawing that agree would hide the rounding
_TIMES = 3  # what is left of what is left: the worst motion comes forth
_GOLDEN = 0.6180339887498949  # the fractional parts of its multiples are spread evenly
_FREE = 0.5  # of a motion without its modes of rows: a free one is all there after a solve


@inner
def _scattered(n: np.uint64, by: float, v: Floats) -> None:
    """v += numbers between -by and by, the same each time."""
    for i in range(n):
        v[i] += by * (2.0 * (_GOLDEN * (i + 1.0) % 1.0) - 1.0)


@inner
def _solved(unit: Unit, system: System, work: Work) -> float:
    """δ = A⁻¹ M v, v in `along`; returns the largest of δ."""
    zero(work.delta)
    add_mass_times(unit, system.mass, 1.0, work.along, work.delta)
    solve(unit, system.pattern, work.diagonal, work.off, work.delta)
    return largest(work.delta, work.p.size)


@compiled
def solve_rounding(unit: Unit, system: System, work: Work, q: Floats, aside: float) -> float:
    """The largest part of a free motion that a solve at q (blocks D, m) leaves; 0 if none is free,
    infinite if there is no factor.

    aside: how far from there instead, in parts of the shortest distance; 0 if rows depend on
    others, as they would not there.
    """
    n, v, delta, worst, before = work.p.size, work.along, work.delta, 0.0, 1.0
    shortest = system.size**2
    for r in range(system.rows.length2.size):
        shortest = min(shortest, system.rows.length2[r])
    copy(q, work.q)
    _scattered(n, aside * np.sqrt(shortest), work.q)
    if not linearise(unit, system, work, work.q):
        return np.inf
    zero(v)
    _scattered(n, 1.0, v)
    for turn in range(_TIMES + 1):
        whole = _solved(unit, system, work)
        copy(delta, v)
        free = _solved(unit, system, work)
        if not free > _FREE * whole:
            break
        if turn > 0:
            worst = max(worst, free / before)
        before = free
        copy(delta, v)
        _solved(unit, system, work)
        for i in range(n):
            v[i] -= delta[i]
    return worst

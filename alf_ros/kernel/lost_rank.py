"""Whether a row has lost its direction where a step ends.

In a singular position itself no solve feels the lost row, so the rank is counted there: where a
stage of the step was near such a position, and where det A has fallen. A row of singular value σ
takes part in det A with 1 + penalty σ².
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.data import System, Work
from alf_ros.kernel.inverse_trace import mass_trace
from alf_ros.kernel.numba_ext.jit import FOUR, ONE, THREE, TWO, ZERO, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, everywhere, pick, unless

_FALLEN = 8.0  # of log det A: a lost row that had s > 100, above which solves are not slow
_FALLEN_BY = np.exp(_FALLEN)
_HALVED = 4.0  # times less det A where a row has half of its σ
_SMALL, _LARGE = 1e-200, 1e200  # between which products are kept


@inner
def inverse_det(unit: Unit, work: Work) -> tuple[float, float]:
    """(c, d) with 1 / det A = c exp(d); the factor in `work` holds reciprocal pivots. d is 0 as
    long as the product can be held without it."""
    D, n, diagonal = np.uint64(len(unit)), np.uint64(work.p.size), work.diagonal
    product, exponent = 1.0, 0.0
    paired = n - n % FOUR
    for a in range(ZERO, paired, FOUR):  # by fours: a product waits for the one before
        b, c, d = a + ONE, a + TWO, a + THREE
        first = diagonal[a * D + a % D] * diagonal[b * D + b % D]
        product *= first * (diagonal[c * D + c % D] * diagonal[d * D + d % D])
        kept = (product > _SMALL) & (product < _LARGE)
        if anywhere(unless(kept)):
            exponent += pick(kept, 0.0, np.log(product))
            product = pick(kept, product, 1.0)
    for a in range(paired, n):
        product *= diagonal[a * D + a % D]
    return product, exponent


@inner
def note_det(unit: Unit, work: Work) -> None:
    """Keep det A for the end of a step."""
    work.inverse_det[2], work.inverse_det[3] = inverse_det(unit, work)


@inner
def begin_with_det(work: Work) -> None:
    """Use det A of the end of a step as the one at the start of the next step."""
    work.inverse_det[0], work.inverse_det[1] = work.inverse_det[2], work.inverse_det[3]


@inner
def fallen(work: Work) -> bool:
    """Whether det A at the end of the step is a small part of what it was where it began."""
    before, product = work.inverse_det[0], work.inverse_det[2]
    difference = work.inverse_det[3] - work.inverse_det[1]
    by_product, same = product > _FALLEN_BY * before, difference == 0.0
    if everywhere(same):
        return by_product
    return pick(same, by_product, difference + np.log(product) - np.log(before) > _FALLEN)


@inner
def _rise(work: Work) -> float:
    """det A at the end of a step over det A where it began; of large numbers only whether it is
    more than 4, 1 or 1/4."""
    before, product = work.inverse_det[0], work.inverse_det[2]
    exponent = work.inverse_det[1] - work.inverse_det[3]
    rise, same = before / product, exponent == 0.0
    if everywhere(same):
        return rise
    change, much = exponent + np.log(before) - np.log(product), np.log(_HALVED)
    up = pick(change > much, 2.0 * _HALVED, 2.0)
    down = pick(change < -much, 0.5 / _HALVED, 0.5)
    return pick(same, rise, pick(change > 0.0, up, down))


@inner
def note_way(work: Work, way: float, made: bool) -> None:
    """Keep how far (m) a step went in which σ of a row was halved or doubled, and how far one that
    leapt over where σ is least. Nothing is kept where `made` does not hold.

    Where a motion passes a singular position, σ falls and rises about in proportion to the way. If
    a step leaps over the position, then σ is halved at least in the step before, and doubled at
    least in the step behind: one of these at least shows it where σ is curved, too.
    """
    rise = _rise(work)
    before, way_before = work.trend[0], work.trend[1]
    much = (rise > _HALVED) | (_HALVED * rise < 1.0)
    leapt = (rise > 1.0) & (before < 1.0) & (much | (_HALVED * before < 1.0))
    work.crossing[2] = pick(made & much, max(work.crossing[2], way), work.crossing[2])
    shorter = min(way, way_before)
    work.crossing[3] = pick(made & leapt, max(work.crossing[3], shorter), work.crossing[3])
    work.trend[0] = pick(made, rise, before)
    work.trend[1] = pick(made, way, way_before)


@inner
def rank_lost(unit: Unit, system: System, work: Work) -> bool:
    """Whether the rank is less than at ordinary positions, by a factor of A without M̂."""
    trace = mass_trace(
        unit,
        system.pattern,
        work.diagonal,
        work.off,
        work.column,
        work.inverse,
        work.inverse_off,
    )
    return work.p.size - trace < system.rank - 0.5


@inner
def lost(unit: Unit, system: System, work: Work) -> bool:
    """The same from the factor in `work`, for any matrix.

    With the M̂ of an implicit method the factor does not give the rank: then the result is true.
    """
    return system.soft.weight.size > 0 or rank_lost(unit, system, work)

"""Whether a row has lost its direction where a step ends.

In a singular position itself no solve feels the lost row, so the rank is counted there: where a
stage of the step was near such a position, and where det A has fallen. A row of singular value σ
takes part in det A with 1 + penalty σ².
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.data import System, Work
from alf_ros.kernel.jit import inner
from alf_ros.kernel.trace import mass_trace

_FALLEN = 8.0  # of log det A: a row for which solves are not slow, s > 100, and is lost then
_SMALL, _LARGE = 1e-200, 1e200  # between which products are kept


@inner
def log_det(unit: Unit, work: Work) -> float:
    """log det A; the factor in `work` holds reciprocal pivots."""
    D = np.uint64(len(unit))
    product, total = 1.0, 0.0
    for a in range(work.p.size):
        product *= work.diagonal[a * D + a % D]
        if not _SMALL < product < _LARGE:
            total -= np.log(product)
            product = 1.0
    return total - np.log(product)


@inner
def fallen(unit: Unit, work: Work) -> bool:
    """Whether det A is a small part of what it was where the step began."""
    return log_det(unit, work) < work.log_det[0] - _FALLEN


@inner
def lost(unit: Unit, system: System, work: Work) -> bool:
    """Whether the rank is less than at ordinary positions, by the factor in `work`.

    With the M̂ of an implicit method the rank cannot be told from the factor: then it may be.
    """
    if system.soft.weight.size > 0:
        return True
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

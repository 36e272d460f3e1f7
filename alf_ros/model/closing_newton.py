"""Newton's iteration that closes a mechanism: q moves along M to where Φ = 0, or rows agree."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel import System, Work
from alf_ros.kernel.compensated import violation_twofold
from alf_ros.kernel.constraints import add_transposed, violation
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import compiled, expanded
from alf_ros.kernel.numba_ext.vectors import largest
from alf_ros.kernel.projection import FAR
from alf_ros.kernel.triangular_solve import solve

_MOST = 200  # iterations
_SHORTEST = 1e-3  # part of a step from which down a shorter one is of no use


@compiled
def settle(
    unit: Unit, system: System, work: Work, least: float, best: Floats, phi: Floats, gap: Floats
) -> bool:
    """Move work.q to where each row is closed to `least` (m), or as far as that goes; returns
    False where A has no factor.

    gap (rows,) is by how much each row stays open, m. best (blocks D,) is memory, in which work.q
    stands on entry; and so is phi (rows,).
    """
    n = work.p.size
    smallest, fraction = np.inf, 1.0
    for _ in range(_MOST):
        widest = opened(unit, system, work, phi, gap)
        if gap.size == 0 or widest <= least:
            break
        if widest < smallest:
            smallest, fraction = widest, 1.0
            for i in range(best.size):
                best[i] = work.q[i]
        else:  # the full step overshot: take half of it from the best place so far
            fraction *= 0.5
            for i in range(best.size):
                work.q[i] = best[i]
            if fraction < _SHORTEST:
                break
            _evaluate(unit, system, work.q, phi)
        if not linearise(unit, system, work, work.q):
            return False
        _turn_into_step(unit, system, work, phi)
        for i in range(n):
            work.q[i] += fraction * work.delta[i]
    opened(unit, system, work, phi, gap)
    return True


@compiled
def settle_as_far_as_rows_agree(
    unit: Unit,
    system: System,
    work: Work,
    part: float,
    most: int,
    best: Floats,
    phi: Floats,
    gap: Floats,
) -> None:
    """Move work.q by full steps, at most so many, as long as each leaves less than a `part` of the
    largest gap. A contradiction stays: its σ is as small as its gap.

    best (blocks D,), phi and gap (rows,) are memory.
    """
    n, least = work.p.size, np.inf
    for _ in range(most):
        widest = opened(unit, system, work, phi, gap)
        if not widest < part * least:
            if not least <= widest:
                return
            break
        least = widest
        for i in range(best.size):
            best[i] = work.q[i]
        if not linearise(unit, system, work, work.q):
            return
        _turn_into_step(unit, system, work, phi)
        for i in range(n):
            work.q[i] += work.delta[i]
    for i in range(best.size):
        work.q[i] = best[i]


@expanded
def _turn_into_step(unit: Unit, system: System, work: Work, phi: Floats) -> None:
    """Φ into δ = -A⁻¹ Φ_qᵀ α Φ, in `work`."""
    rows = system.rows
    for r in range(phi.size):
        phi[r] *= -rows.alpha[r]
    for i in range(work.delta.size):
        work.delta[i] = 0.0
    add_transposed(unit, rows, work.g, work.g2, phi, work.delta)
    solve(unit, system.pattern, work.diagonal, work.off, work.delta)


@expanded
def _evaluate(unit: Unit, system: System, q: Floats, phi: Floats) -> None:
    """Φ(q), far from the origin with twice the digits, as `projection.project` does."""
    if largest(q, q.size) > FAR * system.size:
        violation_twofold(unit, system.rows, q, phi)
    else:
        violation(unit, system.rows, q, phi)


@compiled
def opened(unit: Unit, system: System, work: Work, phi: Floats, gap: Floats) -> float:
    """Φ, by how much each row is open, and the largest of that, m; not a number if one is none."""
    rows, widest = system.rows, 0.0
    _evaluate(unit, system, work.q, phi)
    for r in range(gap.size):
        gap[r] = abs(phi[r]) * rows.scale[r]
        if gap[r] > widest or gap[r] != gap[r]:
            widest = gap[r]
    return widest

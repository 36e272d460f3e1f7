"""M̂ = M + hγ C + (hγ)² K, the matrix in the place of M in a step of an implicit method.

C and K are sums Σ c g gᵀ, Σ k g gᵀ over directions g of compliant effects: c = -∂F/∂ẋ and
k = -∂F/∂x of an effort F on a scalar x, g = ∂x/∂q. Negative c and k count as zero, so that M̂ stays
positive. For an explicit method there are no directions, and nothing is done.
"""

from __future__ import annotations

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import Forces, Soft, System, Work
from alf_ros.kernel.numba_ext.block import add, add_outer, block, dot, packed, put
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, everywhere


@inner
def weigh(unit: Unit, system: System, forces: Forces, work: Work, t: float, step: float) -> None:
    """Directions and weights hγ c + (hγ)² k, `step` = hγ (s), at q, q̇ in `work`."""
    soft, effects = system.soft, forces.effects
    for r in range(soft.weight.size):
        e = soft.effect[r]
        for s in range(soft.first[r], soft.first[r + ONE]):
            put(soft.gradient, soft.block[s], packed(unit, 0.0, 0.0, 0.0))
        call(
            effects.tangent[e],
            t,
            work.q,
            work.qd,
            work.near,
            forces.bearings.loads,
            effects.loads_at[e],
            effects.slots,
            effects.slots_at[e],
            effects.params,
            effects.params_at[e],
            soft.number[r],
            soft.stiff,
            soft.gradient,
        )
        for s in range(soft.first[r], soft.first[r + ONE]):
            put(soft.g, s, block(unit, soft.gradient, soft.block[s]))
        soft.weight[r] = step * max(0.0, soft.stiff[1]) + step * step * max(0.0, soft.stiff[0])


@inner
def add_soft_times(unit: Unit, soft: Soft, s: float, v: Floats, out: Floats) -> None:
    """out += s (M̂ - M) v on movable blocks."""
    for r in range(soft.weight.size):
        along = 0.0
        for e in range(soft.first[r], soft.movable[r]):
            along += dot(block(unit, soft.g, e), block(unit, v, soft.block[e]))
        along *= s * soft.weight[r]
        if anywhere(along != 0.0):
            for e in range(soft.first[r], soft.movable[r]):
                add(out, soft.block[e], along * block(unit, soft.g, e))


@inner
def add_soft(unit: Unit, soft: Soft, diagonal: Floats, off: Floats) -> None:
    """M̂ - M on the pattern, lower blocks."""
    for r in range(soft.weight.size):
        w = soft.weight[r]
        if everywhere(w == 0.0):
            continue
        for e in range(soft.first[r], soft.movable[r]):
            g = block(unit, soft.g, e)
            add_outer(unit, diagonal, soft.block[e], w * g, g)
        for n in range(THREE * soft.first_pair[r], THREE * soft.first_pair[r + ONE], THREE):
            e, f, at = soft.pair[n], soft.pair[n + ONE], soft.pair[n + TWO]
            add_outer(unit, off, at, w * block(unit, soft.g, e), block(unit, soft.g, f))

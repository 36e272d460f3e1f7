"""Which bodies turn about an axis that stays where it is: only their blocks follow circles.

In space a block has an arc (`arc_coordinates`) where its body turns about a steady axis. The ω and
ω̇ of a body follow from its blocks. With d from one of its blocks to another, as a unit vector,

    Σ (I - d dᵀ) ω = Σ d × ḋ,     Σ (I - d dᵀ) ω̇ = Σ d × (d̈ - (ω·d) ω),

and for each radian by which the body turns, its axis turns by |ω × ω̇| / |ω|³. A circle about an
axis that turns is a worse coordinate than the place itself.
"""

from __future__ import annotations

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import ORIGIN, Arms, Phase
from alf_ros.kernel.numba_ext.block import Block, block, cross, dot, packed, zeros
from alf_ros.kernel.numba_ext.jit import ONE, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import pick, unless
from alf_ros.kernel.numba_ext.plain_loops import each

STEADY = 0.1  # rad of the axis in a radian of the body
_FLAT = 1e-9  # of Σ (I - d dᵀ): a body with one d does not turn about it


@inner
def mark_steady(unit: Unit, arms: Arms, phase: Phase, qdd: Floats, marks: Floats) -> None:
    """`marks` (movable,): 1 for each block with an arm in a body about a steady axis, else 0, in
    the motion q, q̇ of `phase` and q̈ (all blocks D,)."""
    for i in range(marks.size):
        marks[i] = 0.0
    for m in each(ONE, arms.first.size):
        begin, end = arms.first[m - ONE], arms.first[m]
        x, y, z, turn = zeros(unit), zeros(unit), zeros(unit), zeros(unit)
        count = _FLAT
        for k in each(begin, end):
            d, scale = _spoke(unit, arms, k, phase.q)
            x, y, z = x + d[0] * d, y + d[1] * d, z + d[2] * d
            turn = turn + scale * cross(d, _between(unit, arms, k, phase.qd))
            count += dot(d, d)
        x = packed(unit, count, 0.0, 0.0) - x
        y = packed(unit, 0.0, count, 0.0) - y
        z = packed(unit, 0.0, 0.0, count) - z
        omega = _solved(unit, x, y, z, turn)
        turn = zeros(unit)
        for k in each(begin, end):
            d, scale = _spoke(unit, arms, k, phase.q)
            bent = scale * _between(unit, arms, k, qdd) - dot(omega, d) * omega
            turn = turn + cross(d, bent)
        aside = cross(omega, _solved(unit, x, y, z, turn))
        square = dot(omega, omega)
        steady = unless(dot(aside, aside) > STEADY * STEADY * square * square * square)
        for k in each(begin, end):
            if arms.turns[k] > 0:
                i = arms.spoke[k]
                marks[i] = pick(steady, 1.0, marks[i])


@inlined
def _between(unit: Unit, arms: Arms, k: int, u: Floats) -> Block:
    """u (all blocks D,) of spoke k, minus u of its hub."""
    v = block(unit, u, arms.spoke[k])
    hub = arms.hub[k]
    if hub != ORIGIN:
        v = v - block(unit, u, hub)
    return v


@inlined
def _spoke(unit: Unit, arms: Arms, k: int, q: Floats) -> tuple[Block, float]:
    """d of spoke k as a unit vector, and what it was multiplied by; 0 for none."""
    d = _between(unit, arms, k, q)
    square = dot(d, d)
    has = square > 0.0
    scale = pick(has, 1.0, 0.0) / pick(has, square, 1.0) ** 0.5
    return scale * d, scale


@inlined
def _solved(unit: Unit, x: Block, y: Block, z: Block, u: Block) -> Block:
    """S⁻¹ u of a symmetric S with these rows."""
    yz = cross(y, z)
    scale = 1.0 / dot(x, yz)
    return packed(
        unit, scale * dot(yz, u), scale * dot(cross(z, x), u), scale * dot(cross(x, y), u)
    )

"""Which components of the reactions rigid bodies leave open, because rows are redundant.

A component of a reaction is w·λ. It is unique if w lies in the range of Φ_q, that is if the
projector Φ_q A⁻¹ Φ_qᵀ α leaves it as it is.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import add_transposed, jacobian, times_jacobian
from alf_ros.kernel.data import Cut, CutWork, Shares, System, Work
from alf_ros.kernel.joint_wrenches import form
from alf_ros.kernel.numba_ext.block import Block, add, block, cross, dot, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, THREE, compiled, inlined, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import zero
from alf_ros.kernel.triangular_solve import solve

OPEN = 1e-6  # part of a component outside of the range, from which on it is not unique …
OPEN_AT_ONCE = 1e-3  # … and from which on one pass tells
_PASSES = 8


@compiled
def open_shares(
    unit: Unit, system: System, cut: Cut, there: CutWork, work: Work, shares: Shares
) -> None:
    """Of each component of force and torque on the child the norm of w, by α, and the part of it
    outside of the range: 0 if it is unique. `work`: q, Φ_q and the factor of A."""
    for b in each(0, cut.source.size):
        put(there.q, b, block(unit, work.q, cut.source[b]))
    jacobian(unit, cut.rows, there.q, there.g, there.g2)
    D = np.uint64(len(unit))
    components = D + (THREE if D == THREE else ONE)
    for n in each(0, cut.first.size - ONE):
        for c in each(0, components):
            if c < D:
                move, spin = _axis(unit, c), packed(unit, 0.0, 0.0, 0.0)
            else:
                move, spin = packed(unit, 0.0, 0.0, 0.0), _axis(unit, c - D)
            _component(unit, cut, there, n, move, spin, shares.w)
            _split(unit, system, work, shares, n * components + c)


@inner
def _component(
    unit: Unit, cut: Cut, there: CutWork, n: np.uint64, move: Block, spin: Block, w: Floats
) -> None:
    """w of joint n: the rates of all rows if its child moves and turns so at the joint alone."""
    zero(there.needed)
    for m in each(cut.points.first[n], cut.points.first[n + ONE]):
        add(there.needed, cut.points.block[m], cut.points.sign[m] * move)
    for m in each(cut.vectors.first[n], cut.vectors.first[n + ONE]):
        b = cut.vectors.block[m]
        turned = _turned(unit, spin, block(unit, there.q, b))
        add(there.needed, b, cut.vectors.sign[m] * turned)
    times_jacobian(unit, cut.rows, there.g, there.g2, there.needed, there.y)
    zero(w)
    for r in each(0, cut.source_row.size):
        w[cut.source_row[r]] = there.y[r]
    origin = form(unit, cut.origins, n, there.q)
    for m in each(cut.first[n], cut.first[n + ONE]):
        arm = block(unit, there.q, cut.block[m]) - cut.is_point[m] * origin
        rate = cut.is_point[m] * move + _turned(unit, spin, arm)
        w[cut.row[m]] -= dot(block(unit, there.g2, cut.entry[m]), rate)


@inner
def _split(unit: Unit, system: System, work: Work, shares: Shares, c: np.uint64) -> None:
    """The norm of w, of component c, and the part of it outside of the range of Φ_q.

    A pass leaves all of it outside, and 1/(1 + s²) of each mode inside. Passes end where the part
    is so large, or so small, that no other pass matters, and where it no longer falls.
    """
    w = shares.w
    whole = _norm(system, w)
    shares.whole[c], shares.part[c] = whole, 0.0
    if not whole > 0.0:
        return
    part = 1.0
    for _ in each(0, _PASSES):
        _project(unit, system, work, shares)
        before, part = part, _norm(system, w) / whole
        if part > OPEN_AT_ONCE or part < OPEN or part > 0.5 * before:
            break
    shares.part[c] = part


@inner
def _project(unit: Unit, system: System, work: Work, shares: Shares) -> None:
    """Subtract Φ_q A⁻¹ Φ_qᵀ α w from w."""
    w, back, x = shares.w, shares.back, shares.x
    for r in range(w.size):
        back[r] = system.rows.alpha[r] * w[r]
    zero(x)
    add_transposed(unit, system.rows, work.g, work.g2, back, x)
    solve(unit, system.pattern, work.diagonal, work.off, x)
    for i in range(work.p.size, x.size):
        x[i] = 0.0
    times_jacobian(unit, system.rows, work.g, work.g2, x, back)
    for r in range(w.size):
        w[r] -= back[r]


@inner
def _norm(system: System, w: Floats) -> float:
    """By α."""
    square = 0.0
    for r in range(w.size):
        square += system.rows.alpha[r] * w[r] ** 2
    return np.sqrt(square)


@inlined
def _axis(unit: Unit, c: np.uint64) -> Block:
    return packed(
        unit, 1.0 if c == 0 else 0.0, 1.0 if c == ONE else 0.0, 1.0 if c == ONE + ONE else 0.0
    )


@inlined
def _turned(unit: Unit, spin: Block, arm: Block) -> Block:
    """spin × arm; in the plane the spin is the first number of its block."""
    if np.uint64(len(unit)) == THREE:
        return cross(spin, arm)
    return packed(unit, -spin[0] * arm[1], spin[0] * arm[0], 0.0)

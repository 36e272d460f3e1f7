"""Prescribed blocks, which move as functions of time and make constraints rheonomic.

Prescribed blocks stand among the fixed blocks, so Φ_q has entries for them. With s(t) their
coordinates, Φ_t = Φ_q,s ṡ is a part of Φ_q q̇, and Φ̈ = Φ_q q̈ + Φ̇_q q̇ + Φ_q,s s̈.
"""

from __future__ import annotations

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import along_gradients, convective, jacobian_rate
from alf_ros.kernel.data import System, Work
from alf_ros.kernel.numba_ext.block import block, dot
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, compiled, inner


@inner
def prescribe(system: System, t: float, q: Floats, qd: Floats, qdd: Floats) -> None:
    """Position, velocity and acceleration of the prescribed blocks at t (s)."""
    given = system.prescribed
    call(given.program, t, given.slots, given.params, given.registers, q, qd, qdd)


@compiled
def prescribed_at(system: System, t: float, q: Floats, qd: Floats, qdd: Floats) -> None:
    """Python entry point. Compiled on first use: a mechanism without drives never compiles it."""
    prescribe(system, t, q, qd, qdd)


@inner
def bias(unit: Unit, system: System, work: Work, out: Floats) -> None:
    """out = Φ̇_q q̇ + Φ_q,s s̈, the part of Φ̈ without accelerations of movable blocks; of rows of
    velocities Ṅ q̇ + … (39)-(41)."""
    jacobian_rate(unit, system.rows, work.qd, work.g2d)
    convective(unit, system.rows, work.g2d, work.qd, out)
    _add_accelerated(unit, system, work, out)


@inner
def bias_of_forms(unit: Unit, system: System, work: Work, out: Floats) -> None:
    """`bias` of the rows that are no distances."""
    jacobian_rate(unit, system.rows, work.qd, work.g2d)
    along_gradients(unit, system.rows, work.g2d, work.qd, out)
    _add_accelerated(unit, system, work, out)


@inner
def _add_accelerated(unit: Unit, system: System, work: Work, out: Floats) -> None:
    """out += Φ_q,s s̈; no distance row has a prescribed block."""
    if system.prescribed.program.size == 0:
        return
    rows, g2, qdd = system.rows, work.g2, work.qdd
    m1 = rows.i.size
    for r in range(rows.movable.size):
        for e in range(rows.movable[r], rows.first[r + ONE]):
            out[m1 + r] += dot(block(unit, g2, e), block(unit, qdd, rows.block[e]))

"""Where many members of one geometry start: closed, examined at places nearby, and their
velocities completed, each by the functions that start a single mechanism.

`ordinary_positions` and `assembly` decide for a single one what to look at next. Nearly all
members of a study are ordinary: they close as drawn, have their full rank there and at the places
nearby, and are far from singular positions. These are examined here, one after another in one
call. A member with anything else is left to the long way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Unit
from alf_ros.kernel import System, Until, Work, augmented, linearise, mass_trace, times_jacobian
from alf_ros.kernel.numba_ext.jit import ZERO, compiled
from alf_ros.kernel.numba_ext.lane_structs import struct_at
from alf_ros.kernel.numba_ext.structs import Struct
from alf_ros.kernel.numba_ext.vectors import zero
from alf_ros.model.closing_newton import settle

PLACES = 4  # examined of each member: where it closes, and three around it


@dataclass(frozen=True, eq=False)
class MemberPlaces(Struct):
    """Where members close, with residuals and ranks there."""

    addresses = ('system', 'soft')

    system: Addresses  # (members,) of its System
    soft: Addresses  # (penalties, members) of its System with other penalties
    drawn: Floats  # (all blocks D,) m
    away: Floats  # (PLACES, movable D) m, of the places from the closed one
    q: Floats  # (members, all blocks D) m, closed
    gap: Floats  # (members, PLACES) m, by how much rows stay open; not a number without a factor
    trace: Floats  # (members, PLACES) tr(M A⁻¹) there; not a number without a factor
    soft_trace: Floats  # (members, penalties) where it closes
    best: Floats  # (all blocks D,) memory
    phi: Floats  # (rows,) memory
    open: Floats  # (rows,) memory
    Z: Floats  # (movable D D,) memory
    Zo: Floats  # (blocks D D,) memory


@compiled
def close_members(unit: Unit, of: System, work: Work, least: float, found: MemberPlaces) -> None:
    """Close each member to `least` (m) from the drawing, then from the places around that, and
    count the rank at each. `of`: the System of any member; `work`: memory for one."""
    members, size, n = np.uint64(found.system.size), np.uint64(found.drawn.size), work.p.size
    places, softer = np.uint64(PLACES), np.uint64(found.soft.size // found.system.size)
    for m in range(ZERO, members):
        system = struct_at(of, found.system[m])
        for place in range(ZERO, places):
            for i in range(ZERO, size):
                work.q[i] = found.drawn[i] if place == ZERO else found.q[m * size + i]
                if place > ZERO and i < n:
                    work.q[i] += found.away[place * n + i]
                found.best[i] = work.q[i]
            at = m * places + place
            found.gap[at] = found.trace[at] = np.nan
            if not settle(unit, system, work, least, found.best, found.phi, found.open):
                break
            widest = 0.0
            for r in range(found.open.size):
                if found.open[r] > widest or found.open[r] != found.open[r]:
                    widest = found.open[r]
            found.gap[at] = widest
            if place == ZERO:
                for i in range(ZERO, size):
                    found.q[m * size + i] = work.q[i]
            if linearise(unit, system, work, work.q):
                found.trace[at] = _trace(unit, system, work, found)
        for i in range(ZERO, size):
            work.q[i] = found.q[m * size + i]
        for s in range(ZERO, softer):
            soft = struct_at(of, found.soft[s * members + m])
            found.soft_trace[m * softer + s] = np.nan
            if linearise(unit, soft, work, work.q):
                found.soft_trace[m * softer + s] = _trace(unit, soft, work, found)


@compiled
def _trace(unit: Unit, system: System, work: Work, found: MemberPlaces) -> float:
    """tr(M A⁻¹) with the factor in `work`."""
    pattern, Z, Zo = system.pattern, found.Z, found.Zo
    return mass_trace(unit, pattern, work.diagonal, work.off, work.column, Z, Zo)


@dataclass(frozen=True, eq=False)
class MemberVelocities(Struct):
    """Velocities of members, completed from those given."""

    addresses = ('system',)

    system: Addresses  # (members,) of its System, with rows for the velocities given
    q: Floats  # (members, all blocks D) m, closed
    wanted: Floats  # (members, rows) m/s
    qd: Floats  # (members, all blocks D) m/s
    wrong: Floats  # (members,) m/s, by which rows are off at most
    x: Floats  # (all blocks D,) memory
    rate: Floats  # (rows,) memory


@compiled
def complete_members(
    unit: Unit, of: System, work: Work, until: Until, found: MemberVelocities
) -> None:
    """The velocities of each member with Φ_q q̇ = 0 and the given ones, of least kinetic energy.
    `of`, `work` as in `close_members`, of the systems with more rows."""
    members, size, m_rows = np.uint64(found.system.size), found.x.size, found.rate.size
    for m in range(ZERO, members):
        system = struct_at(of, found.system[m])
        for i in range(ZERO, size):
            work.q[i] = found.q[m * size + i]
            work.qd[i] = found.x[i] = 0.0
        zero(work.p)
        zero(work.y)
        found.wrong[m] = np.nan
        if not linearise(unit, system, work, work.q):
            continue
        times_jacobian(unit, system.rows, work.g, work.g2, found.x, work.r2)
        for r in range(ZERO, m_rows):
            work.r2[r] = found.wanted[m * m_rows + r] - work.r2[r]
        augmented(unit, system, work, work.p, found.x, until)
        times_jacobian(unit, system.rows, work.g, work.g2, found.x, found.rate)
        wrong = 0.0
        for r in range(ZERO, m_rows):
            off = abs(found.rate[r] - found.wanted[m * m_rows + r]) * system.rows.scale[r]
            if off > wrong or off != off:
                wrong = off
        found.wrong[m] = wrong
        for i in range(ZERO, size):
            found.qd[m * size + i] = found.x[i]

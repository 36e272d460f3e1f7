"""Where many members of one structure start: closed, here and at places nearby, their ranks there,
and their velocities completed, each by the functions that start a single mechanism.

`ordinary_positions` and `assembly` decide for a single one what to look at next. Nearly all
members of a study are ordinary: they close as drawn, have their full rank there, and are far from
singular positions, or soft everywhere. These are examined here, one after another in one call. A
member with anything else is left to the long way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Integers, Unit
from alf_ros.kernel import System, Until, Work, augmented, linearise, mass_trace, times_jacobian
from alf_ros.kernel.numba_ext.jit import ZERO, compiled
from alf_ros.kernel.numba_ext.lane_structs import section, struct_at
from alf_ros.kernel.numba_ext.structs import Struct
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.solve_rounding import solve_rounding
from alf_ros.model.closing_newton import settle

PLACES = 4  # examined of each member: where it closes, and three around it
_SLOW = 0.5  # part of a residual that a round leaves, from which down a solve is as usual


@dataclass(frozen=True, eq=False)
class MemberPlaces(Struct):
    """Where members close, with residuals there."""

    addresses = ('system',)

    system: Addresses  # (members,) of its System
    wanted: Integers  # (members,) 1 where it is asked for
    drawn: Floats  # (members, all blocks D) m
    away: Floats  # (PLACES, movable D) of the places from the closed one, directions
    q: Floats  # (members, PLACES, all blocks D) m, closed
    gap: Floats  # (members, PLACES) m, by how much rows stay open; not a number without a factor
    best: Floats  # (all blocks D,) memory
    phi: Floats  # (rows,) memory
    open: Floats  # (rows,) memory


@compiled
def close_members(
    unit: Unit, of: System, work: Work, least: float, near: float, place: int, found: MemberPlaces
) -> None:
    """Close the members that are `wanted` to `least` of the size, from the drawing, or from one of
    the places around where they close, `near` of the size away. `of`: the System of any member;
    `work`: memory for one."""
    members, size, n = np.uint64(found.system.size), np.uint64(work.q.size), work.p.size
    which, places = np.uint64(place), np.uint64(PLACES)
    for m in range(ZERO, members):
        if found.wanted[m] == 0:
            continue
        system, first, at = struct_at(of, found.system[m]), m * places * size, m * places + which
        away = near * system.size
        for i in range(ZERO, size):
            work.q[i] = found.drawn[m * size + i] if which == ZERO else found.q[first + i]
            if which > ZERO and i < n:
                work.q[i] += away * found.away[which * n + i]
            found.best[i] = work.q[i]
        found.gap[at] = np.nan
        if settle(unit, system, work, least * system.size, found.best, found.phi, found.open):
            widest = 0.0
            for r in range(found.open.size):
                if found.open[r] > widest or found.open[r] != found.open[r]:
                    widest = found.open[r]
            found.gap[at] = widest
        for i in range(ZERO, size):
            found.q[at * size + i] = work.q[i]


@dataclass(frozen=True, eq=False)
class MemberRanks(Struct):
    """Traces at one of the places of members, from which their ranks follow, and roundings."""

    addresses = ('system',)

    system: Addresses  # (members,) of its System
    wanted: Integers  # (members,) 1 where it is asked for
    q: Floats  # (members, PLACES, all blocks D) m
    trace: Floats  # (members,) tr(M A⁻¹) there, not a number without a factor
    rounding: Floats  # (members,) `solve_rounding` where they close
    Z: Floats  # (movable D D,) memory
    Zo: Floats  # (blocks D D,) memory


@compiled
def trace_members(unit: Unit, of: System, work: Work, place: int, found: MemberRanks) -> None:
    """tr(M A⁻¹) of the members that are `wanted`, at one of their places."""
    members, size = np.uint64(found.system.size), np.uint64(work.q.size)
    for m in range(ZERO, members):
        if found.wanted[m] == 0:
            continue
        first = (m * np.uint64(PLACES) + np.uint64(place)) * size
        copy(section(found.q, first, size), work.q)
        system = struct_at(of, found.system[m])
        found.trace[m] = np.nan
        if linearise(unit, system, work, work.q):
            Z, Zo, diagonal, off = found.Z, found.Zo, work.diagonal, work.off
            column, pattern = work.column, system.pattern
            found.trace[m] = mass_trace(unit, pattern, diagonal, off, column, Z, Zo)


@compiled
def round_members(unit: Unit, of: System, work: Work, aside: float, found: MemberRanks) -> None:
    """`solve_rounding` of the members that are `wanted`, where they close."""
    members, size = np.uint64(found.system.size), np.uint64(work.q.size)
    for m in range(ZERO, members):
        if found.wanted[m] == 0:
            continue
        first = m * np.uint64(PLACES) * size
        copy(section(found.q, first, size), work.shift)
        system = struct_at(of, found.system[m])
        found.rounding[m] = solve_rounding(unit, system, work, work.shift, aside)


@dataclass(frozen=True, eq=False)
class MemberVelocities(Struct):
    """Velocities of members, completed from those given."""

    addresses = ('system',)

    system: Addresses  # (members,) of its System, with rows for the velocities given
    q: Floats  # (members, PLACES, all blocks D) m; it starts at the first
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
            work.q[i] = found.q[m * np.uint64(PLACES) * size + i]
            work.qd[i] = found.x[i] = 0.0
        zero(work.p)
        zero(work.y)
        found.wrong[m] = np.nan
        if not linearise(unit, system, work, work.q):
            continue
        times_jacobian(unit, system.rows, work.g, work.g2, found.x, work.r2)
        for r in range(ZERO, m_rows):
            work.r2[r] = found.wanted[m * m_rows + r] - work.r2[r]
        _count, slowest = augmented(unit, system, work, work.p, found.x, until)
        if slowest > _SLOW:
            continue  # rounding decides where it ends: a single start says how
        times_jacobian(unit, system.rows, work.g, work.g2, found.x, found.rate)
        wrong = 0.0
        for r in range(ZERO, m_rows):
            off = abs(found.rate[r] - found.wanted[m * m_rows + r]) * system.rows.scale[r]
            if off > wrong or off != off:
                wrong = off
        found.wrong[m] = wrong
        for i in range(ZERO, size):
            found.qd[m * size + i] = found.x[i]

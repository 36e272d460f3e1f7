"""The slip of gears, racks, threads, wheels on a line and couplings: Φ of rows of velocities that
have an integral.

Such a row is the derivative of a sum of angles and lengths, Σ a_n x_n. Its Φ is the sum less its
value in the state. An angle is the sum of a remainder θ, |θ| ≤ π, and of whole turns k. Turns are
added up with their rounding errors, because the products a_n k_n of many turns nearly cancel. So
the slip is known to the rounding of one turn, however many there are.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.kernel.compensated import exact_product, exact_sum
from alf_ros.kernel.constraints import form
from alf_ros.kernel.data import EPS, Phase, System, Work
from alf_ros.kernel.numba_ext.jit import ONE, TWO, compiled, inlined, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import vector
from alf_ros.kernel.numba_ext.vectors import copy

_ROUNDED = 2.0  # rounding units of the largest term: a slip that rounding explains


@inner
def begin_slips(unit: Unit, system: System, work: Work, phase: Phase) -> None:
    """Store the angles with their turns where a step begins, and the values of the sums."""
    if work.sums.size > 0:
        begin_angles(unit, system, phase.q, phase.turns, work.begun)
        copy(phase.sums, work.sums)


@inner
def begin_angles(unit: Unit, system: System, q: Floats, turns: Integers, begun: Floats) -> None:
    """The angles of the sums with their turns, rad."""
    for n in each(0, begun.size):
        place = np.uint64(system.integrals.angle[n])
        begun[n] = _angle(unit, system, place, q) + 2.0 * np.pi * turns[place]


@inlined
def _angle(unit: Unit, system: System, n: np.uint64, q: Floats) -> float:
    """A counted angle without its turns, rad."""
    x, y = form(unit, system.angles, TWO * n, q), form(unit, system.angles, TWO * n + ONE, q)
    return np.arctan2(y + 0.0, x)  # of -0.0 as turns are counted


@inner
def add_slips(unit: Unit, system: System, work: Work, q: Floats, phi: Floats) -> float:
    """Φ of the rows that have an integral (m), into `phi`; returns the widest slip beyond
    rounding, m.

    No angle may be more than half a turn from where the step began.
    """
    integrals, widest = system.integrals, 0.0
    velocities = system.rows.i.size + system.rows.c.size
    _measure(unit, system, work.begun, q, work.measured)
    for n in each(0, integrals.row.size):
        value, largest = _sum(unit, system, work.measured, n, q)
        row, slip = velocities + integrals.row[n], value - work.sums[n]
        phi[row] = slip
        widest = max(widest, (abs(slip) - _ROUNDED * EPS * largest) * system.rows.scale[row])
    return widest


@inner
def _measure(unit: Unit, system: System, begun: Floats, q: Floats, measured: Floats) -> None:
    """The remainder (rad) and the turns of each angle of the sums, at most half a turn from
    `begun`."""
    for n in each(0, begun.size):
        angle = _angle(unit, system, np.uint64(system.integrals.angle[n]), q)
        measured[TWO * n] = angle
        measured[TWO * n + ONE] = np.rint((begun[n] - angle) / (2.0 * np.pi))


@inlined
def _sum(
    unit: Unit, system: System, measured: Floats, n: np.uint64, q: Floats
) -> tuple[float, float]:
    """The sum of one row (m), and its largest term."""
    integrals = system.integrals
    angles = integrals.angle.size
    value, largest, turned, rest = 0.0, 0.0, 0.0, 0.0
    for k in each(integrals.first[n], integrals.first[n + ONE]):
        place, factor = np.uint64(integrals.place[k]), integrals.factor[k]
        if place < angles:
            part, less = exact_product(factor, measured[TWO * place + ONE])
            turned, lost = exact_sum(turned, part)
            rest += lost + less
            term = factor * measured[TWO * place]
        else:
            term = factor * form(unit, integrals.lengths, place - angles, q)
        value += term
        largest = max(largest, abs(term))
    whole = 2.0 * np.pi * (turned + rest)
    return value + whole, max(largest, abs(whole))


@compiled
def integral_values(
    unit: Unit, system: System, work: Work, q: Floats, turns: Integers, sums: Floats
) -> None:
    """The values of the sums (m) at q with turns."""
    q, turns, sums = vector(q), vector(turns), vector(sums)
    begin_angles(unit, system, q, turns, work.begun)
    _measure(unit, system, work.begun, q, work.measured)
    for n in each(0, sums.size):
        sums[n], _ = _sum(unit, system, work.measured, n, q)


@compiled
def slips(
    unit: Unit,
    system: System,
    work: Work,
    q: Floats,
    turns: Integers,
    sums: Floats,
    phi: Floats,
) -> float:
    """`add_slips` at q with turns, for sums of these values (m)."""
    if work.sums.size == 0:
        return 0.0
    q, turns, sums, phi = vector(q), vector(turns), vector(sums), vector(phi)
    begin_angles(unit, system, q, turns, work.begun)
    copy(sums, work.sums)
    return add_slips(unit, system, work, q, phi)

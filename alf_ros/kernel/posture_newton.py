"""Newton's method for postures: the rows of loops and of active joint coordinates, and sums.

Newton's method moves q along M: δ = -A⁻¹ Φ_qᵀ α Φ, with the factor of A = M + Φ_qᵀ α Φ_q. In a
mode of singular value s it does s² / (1 + s²) of the correction, where s² = penalty σ², so its
steps stay finite in a singular position.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers, Unit
from alf_ros.kernel.augmented_solve import finish
from alf_ros.kernel.constraints import add_transposed, violation
from alf_ros.kernel.data import EPS, EVERY_MODE, System, Work
from alf_ros.kernel.data.closing import CORRECTIONS, FACTORED, Closing
from alf_ros.kernel.joint_coordinates import counted_angles, joint_coordinates
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.block import packed, put
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.projection import opening
from alf_ros.kernel.slip import begin_angles
from alf_ros.kernel.triangular_solve import solve
from alf_ros.kernel.unwrapping import count_turns

_ROUNDS = 40  # of Newton's method
LEAP = 0.3  # of the size: longest correction, and longest way on which the motion is believed
_CLOSED = 4.0  # rounding units of the size
_EXACT = 1e-3  # of x, a step that ends the residuals of a correction
_CONTRACTS = 0.5  # of a correction, the next one with the same factor
_NEARLY = 1e-13  # of the size: closed, where rounding ends the convergence
_ROUNDED = 4.0  # rounding units of the largest number of a row, as far away or after many turns
_SLOW = 0.2  # of two gaps: a mode converges slowly
_SHORTEST = 1.0 / 64.0  # of a correction
_SLIGHT = 0.01  # of the way from `before`: a first correction that tells nothing of a branch


@inner
def put_values(closing: Closing, values: Floats) -> None:
    """The prescribed blocks of the active coordinates at these values (rad, m)."""
    unit, q, size = closing.unit, closing.work.q, closing.tight.size
    for n in each(0, closing.block.size):
        x = values[n]
        if closing.is_angle[n] != 0:
            put(q, closing.block[n], packed(unit, size * np.cos(x), size * np.sin(x), 0.0))
        else:
            put(q, closing.block[n], packed(unit, x, 0.0, 0.0))


@inner
def _correct(unit: Unit, system: System, work: Work, exactly: bool, x: Floats) -> None:
    """x = -A⁻¹ Φ_qᵀ α Φ with Φ in r2; `exactly`: as Newton's method has it, also in modes that are
    so soft that A holds them back. Rows that depend on others contradict each other by the square
    of the last correction, which `finish` leaves alone."""
    if exactly:
        zero(x)
        for r in range(work.r2.size):
            work.r2[r], work.y[r] = -work.r2[r], 0.0
        finish(unit, system, work, x, _EXACT, EVERY_MODE)
        return
    for r in range(work.r2.size):
        work.r2[r] *= -system.rows.alpha[r]
    zero(work.delta)
    add_transposed(unit, system.rows, work.gf, work.g2f, work.r2, work.delta)
    solve(unit, system.pattern, work.diagonal, work.off, work.delta)
    for a in range(work.p.size):
        x[a] = work.delta[a]


@inner
def count(closing: Closing, before: Floats, turns: Integers) -> None:
    """Count the turns of the angles from q to the q in `work`."""
    work, angles = closing.work, closing.tight.angles
    violation(closing.unit, angles, before, work.angle_before)
    violation(closing.unit, angles, work.q, work.angle)
    count_turns(work.angle_before, work.angle, turns)


@inner
def read(closing: Closing, q: Floats, turns: Integers) -> None:
    """Joint coordinates at q, and their rates with the q̇ in `work`."""
    unit, work = closing.unit, closing.work
    angles, spins = closing.angles, closing.spins
    counted_angles(unit, closing.tight.angles, q, work.qd, turns, angles, spins, closing.near)
    joint_coordinates(
        unit, closing.joints, q, work.qd, angles, spins, closing.values, closing.rates
    )


@inner
def begin_at(closing: Closing, q: Floats) -> None:
    """Begin a step on the way at q, where angles have the turns in `turned`."""
    copy(q, closing.before)
    if closing.work.sums.size > 0:
        begin_angles(closing.unit, closing.tight, q, closing.turned, closing.work.begun)


@inner
def _contracts(closing: Closing, system: System, fraction: float, exactly: bool) -> bool:
    """Whether the next correction, with the factor of the last one, is less than half of it.

    A thread or a gear that turns far in a small motion opens its body by the square of the angle,
    which is more than the gap that Newton's method closes, though it converges.
    """
    work, n = closing.work, closing.work.p.size
    if work.sums.size == 0:
        return False
    _correct(closing.unit, system, work, exactly, work.shift)
    opening(closing.unit, system, work)  # Φ, which the correction has overwritten
    return largest(work.shift, n) < _CONTRACTS * fraction * largest(work.target, n)


@inner
def settle(closing: Closing, system: System, exactly: bool) -> bool:
    """Move q in `work` along M to where its rows are closed; returns whether they are.

    A correction that opens the rows further is halved, unless the next one is small. Rounding ends
    the convergence only of corrections that are Newton's in every mode. `way`: the first one;
    `exactly`: it is Newton's in soft modes too.

    The gradient of a sum of angles fits closed loops. A first correction that closes them
    leaves some of the sum, which moves a soft mode far. If that correction was slight, `way` has
    the second one as well.
    """
    unit, work, way, counts = closing.unit, closing.work, closing.way, closing.counts
    size, n = system.size, work.p.size
    known = largest(work.q, n)
    if work.sums.size > 0:
        for k in each(0, closing.turned.size):
            known = max(known, size * 2.0 * np.pi * abs(closing.turned[k]))
    nearly = max(_NEARLY * size, _ROUNDED * EPS * known)
    best, fraction, first, second, slow = np.inf, 1.0, True, False, exactly
    counts[FACTORED] = 0
    for _ in range(_ROUNDS):
        gap = opening(unit, system, work)
        if gap <= _CLOSED * EPS * size:
            if first:
                zero(way)
            return True
        if gap < best or _contracts(closing, system, fraction, slow):
            if slow and gap > 0.25 * best and gap <= nearly:
                return True
            slow = exactly or gap > _SLOW * best
            best, fraction = gap, 1.0
            copy(work.q, work.base)
            if not linearise(unit, system, work, work.q):
                return False
            _correct(unit, system, work, slow, work.target)
            length = largest(work.target, n)
            if length > LEAP * size:
                fraction = LEAP * size / length
            if first:
                for a in range(n):
                    way[a] = fraction * work.target[a]
                first, second = False, work.sums.size > 0
            elif second:
                second = False
                if largest(way, n) <= _SLIGHT * furthest(work.base, closing.before, n):
                    for a in range(n):
                        way[a] += fraction * work.target[a]
            counts[CORRECTIONS] += 1
            counts[FACTORED] += 1
        else:
            fraction *= 0.5
            if fraction < _SHORTEST:
                copy(work.base, work.q)
                return best <= nearly
        for a in range(n):
            work.q[a] = work.base[a] + fraction * work.target[a]
    return best <= nearly


@inner
def sharpness(closing: Closing) -> float:
    """The logarithm of a number that is proportional to the least singular value, near a position
    where that vanishes: half the logarithm of det A, where the last correction
    began."""
    unit, system, work = closing.unit, closing.tight, closing.work
    if closing.counts[FACTORED] == 0:
        linearise(unit, system, work, work.q)
    D = len(unit)
    product, logarithm = 1.0, 0.0
    for a in range(work.p.size):
        product *= work.diagonal[(a // D) * D * D + (a % D) * (D + 1)]  # of D⁻¹
        if not 1e-200 < product < 1e200:
            logarithm -= 0.5 * np.log(product)
            product = 1.0
    return logarithm - 0.5 * np.log(product)

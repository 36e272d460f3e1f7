"""Velocities of a mechanism whose active joint coordinates have rows of their own."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.augmented_solve import augmented
from alf_ros.kernel.constraints import times_jacobian
from alf_ros.kernel.data import Until
from alf_ros.kernel.data.closing import Closing
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import block, packed, put
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.posture_newton import read

_ROUNDS = 100
_MET = 1e-6  # of the rates given, by which rates may miss them
_ROUNDED = 1e-12  # of all rates, that is rounding


@compiled
def linearise_posture(closing: Closing) -> bool:
    """Φ_q and the factor of A at the posture; returns whether A was positive definite."""
    return linearise(closing.unit, closing.tight, closing.work, closing.q)


@inner
def _solve(closing: Closing, given: Floats, guess: Floats, speed: float) -> None:
    """q̇ in `work` at these rates (active,), rad/s or m/s; of all such the one that the impulse of
    the rows makes of `speed` times the guess (movable D,)."""
    unit, system, work = closing.unit, closing.tight, closing.work
    zero(work.qd)
    zero(work.p)
    for a in range(guess.size):
        work.qd[a] = speed * guess[a]
    if speed != 0.0:
        add_mass_times(unit, system.mass, 1.0, work.qd, work.p)
    for n in each(0, closing.block.size):
        i, rate = closing.block[n], given[n]
        if closing.is_angle[n] != 0:
            s = block(unit, closing.q, i)
            put(work.qd, i, packed(unit, -rate * s[1], rate * s[0], 0.0))
        else:
            put(work.qd, i, packed(unit, rate, 0.0, 0.0))
    times_jacobian(unit, system.rows, work.g, work.g2, work.qd, work.r2)
    for r in range(work.r2.size):
        work.r2[r], work.y[r] = -work.r2[r], 0.0
    augmented(unit, system, work, work.p, work.qd, Until(_ROUNDS, 1e-15, 1.0))


@inner
def _are_met(closing: Closing, given: Floats, guessed: float) -> bool:
    """Whether the q̇ in `work` has these rates (active,), which no q̇ may have in a dead point.
    `rates` are then the rates of all joint coordinates. `guessed`: the largest q̇ of the guess,
    m/s: its rounding stays where all rates are zero."""
    read(closing, closing.q, closing.turns)
    size, missed, asked, largest = closing.tight.size, 0.0, 0.0, 0.0
    for k in range(closing.rates.size):
        largest = max(largest, abs(closing.rates[k]))
    for n in range(given.size):
        length = size if closing.is_angle[n] != 0 else 1.0
        missed = max(missed, length * abs(closing.rates[closing.active[n]] - given[n]))
        asked = max(asked, length * abs(given[n]))
    return missed <= _MET * asked + _ROUNDED * (max(1.0, size) * largest + guessed)


@compiled
def rates_at(closing: Closing, given: Floats, speed: float, qd: Floats) -> bool:
    """q̇ (blocks D,) from rates (active,), rad/s or m/s, with the factor at the posture; returns
    whether a q̇ has these rates.

    speed: calls per second, for the guess from the motion so far; 0: no guess. A direction that
    the rows do not determine, as in a dead point, keeps the guess.
    """
    _solve(closing, given, closing.rate, speed)
    copy(closing.work.qd, qd)
    fastest = 0.0
    for a in range(closing.rate.size):
        fastest = max(fastest, abs(closing.rate[a]))
    return _are_met(closing, given, speed * fastest)


@compiled
def rate_matrix(closing: Closing, given: Floats, matrix: Floats) -> None:
    """∂x/∂x_a, (active, joint coordinates) flat: the rates of all joint coordinates as one active
    coordinate moves at unit speed and the others rest, NaN where nothing moves so. `given`
    (active,): to write in."""
    for n in range(given.size):
        for k in range(given.size):
            given[k] = 1.0 if k == n else 0.0
        _solve(closing, given, closing.rate, 0.0)
        met = _are_met(closing, given, 0.0)
        for k in range(closing.rates.size):
            matrix[n * closing.rates.size + k] = closing.rates[k] if met else np.nan

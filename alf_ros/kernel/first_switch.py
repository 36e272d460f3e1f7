"""The first step in which a function of time takes another branch at a corner."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.data import System
from alf_ros.kernel.data.drive_switches import DriveSwitches
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.prescribed import prescribe

RATE = -2  # instead of an instruction: the rate of the first one is compared with zero
_HALVINGS = 60


@compiled
def compare_at(
    system: System, switches: DriveSwitches, t: float, values: Floats, rates: Floats
) -> None:
    """By how much the first number compared is more than the second one at t (s), and the rate of
    this difference. The drives are put into q, q̇, q̈ of `switches`."""
    prescribe(system, t, switches.q, switches.qd, switches.qdd)
    registers = system.prescribed.registers
    for n in range(values.size):
        a, b = switches.compared[2 * n], switches.compared[2 * n + 1]
        at = 3 * a + (b == RATE)
        values[n], rates[n] = registers[at], registers[at + 1]
        if b >= 0:
            values[n] -= registers[3 * b]
            rates[n] -= registers[3 * b + 1]


@compiled
def branches_at(system: System, switches: DriveSwitches, t: float, out: Integers) -> None:
    """The branches at t (s): 1 if the first number compared is not less than the second one."""
    compare_at(system, switches, t, switches.value, switches.rate)
    for n in range(out.size):
        out[n] = 1 if switches.value[n] >= 0.0 else 0


@inner
def _may_turn(switches: DriveSwitches, n: int, h: float) -> bool:
    """Whether a difference approaches zero where a step of h (s) starts, leaves it where the step
    ends, and has tangents that pass zero before they meet."""
    v, w = switches.before[n], switches.value[n]
    r, s = switches.rate_before[n], switches.rate[n]
    if not (v * w > 0.0 and v * r < 0.0 and w * s > 0.0):
        return False
    return v * (v + r * (w - s * h - v) / (r - s)) <= 0.0


@compiled
def excursion(system: System, switches: DriveSwitches, low: float, high: float) -> float:
    """An instant between two (s) at which a branch is another one than at both of them; not a
    number if none is known. The turning point of a difference is found by bisection."""
    compare_at(system, switches, low, switches.before, switches.rate_before)
    compare_at(system, switches, high, switches.value, switches.rate)
    for n in range(switches.value.size):
        if not _may_turn(switches, n, high - low):
            continue
        first, last, v = low, high, switches.before[n]
        for _ in range(_HALVINGS):
            middle = 0.5 * (first + last)
            compare_at(system, switches, middle, switches.value, switches.rate)
            if v * switches.value[n] < 0.0:
                return middle
            if v * switches.rate[n] < 0.0:
                first = middle
            else:
                last = middle
        compare_at(system, switches, high, switches.value, switches.rate)
    return np.nan


@compiled
def first_switch(
    system: System, switches: DriveSwitches, t0: float, first: int, count: int, h: float
) -> np.int64:
    """In which of `count` steps of h (s) from t0 + first h (s) on a branch becomes another than
    `here`; `count` if none does.

    Their ends are rounded as the ones of all steps: each has the same corners, whichever step is
    the first.
    """
    t = t0 + first * h
    compare_at(system, switches, t, switches.before, switches.rate_before)
    for n in range(count):
        end = t0 + (first + n + 1) * h
        branches_at(system, switches, end, switches.there)
        turns = False
        for k in range(switches.there.size):
            if switches.there[k] != switches.here[k]:
                return np.int64(n)
            turns |= _may_turn(switches, k, h)
        if turns:
            found = excursion(system, switches, t, end)
            if found == found:
                return np.int64(n)
        copy(switches.value, switches.before)
        copy(switches.rate, switches.rate_before)
        t = end
    return np.int64(count)

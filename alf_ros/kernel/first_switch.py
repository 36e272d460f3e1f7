"""Steps in which the function of time of a drive takes another branch at a corner."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Integers
from alf_ros.kernel.data import System
from alf_ros.kernel.data.drive_switches import DriveSwitches
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.kernel.prescribed import prescribe

RATE = -2  # instead of an instruction: the rate of the first one is compared with zero


@compiled
def branches_at(system: System, switches: DriveSwitches, t: float, out: Integers) -> None:
    """The branches at t (s): 1 if the first number compared is not less than the second one. The
    drives are put into q, q̇, q̈ of `switches`."""
    prescribe(system, t, switches.q, switches.qd, switches.qdd)
    registers = system.prescribed.registers
    for n in range(out.size):
        a, b = switches.compared[2 * n], switches.compared[2 * n + 1]
        least = registers[3 * b] if b >= 0 else 0.0
        out[n] = 1 if registers[3 * a + (b == RATE)] >= least else 0


@compiled
def first_switch(
    system: System, switches: DriveSwitches, t: float, h: float, count: int
) -> np.int64:
    """In which of `count` steps of h (s) from t (s) on a branch becomes another than `here`;
    `count` if none does."""
    for n in range(count):
        branches_at(system, switches, t + (n + 1) * h, switches.there)
        for k in range(switches.there.size):
            if switches.there[k] != switches.here[k]:
                return np.int64(n)
    return np.int64(count)

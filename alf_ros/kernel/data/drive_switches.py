"""Data of the search for steps in which functions of time switch."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class DriveSwitches(Struct):
    """The instructions of the program of the drives that may have corners, and memory."""

    # (switches 2,) an instruction and the one it is compared with; -1: with zero, -2: its rate is
    compared: Integers
    here: Integers  # (switches,) the branch of each, 0 or 1
    there: Integers  # (switches,) likewise, at the end of a step
    value: Floats  # (switches,) by how much the first number compared is more than the second
    rate: Floats  # (switches,) of this difference, 1/s
    before: Floats  # (switches,) likewise, at the start of a step
    rate_before: Floats  # (switches,)
    q: Floats  # (blocks D,) of the drives
    qd: Floats  # (blocks D,)
    qdd: Floats  # (blocks D,)

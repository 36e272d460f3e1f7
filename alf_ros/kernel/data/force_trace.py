"""The trace of all forces at a stage: what they follow from, and their slopes along it."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class ForceTrace(Struct):
    """See `traced_numbers`. The leaves of the trace are q, q̇ and `Effects.params`."""

    addresses = ('force',)

    force: Addresses  # (effects,) of the forces for traced numbers
    numbers: Integers  # (leaves,) of the leaves in the trace; -1: it counts as a constant
    words: Integers  # (3 + 2 operations,)
    slopes: Floats  # (2 operations,)
    Q: Floats  # (all blocks D,) the forces
    made: Integers  # (all blocks D,) the number of the trace that each of Q follows from
    along: Floats  # (all blocks D,) its slope along this

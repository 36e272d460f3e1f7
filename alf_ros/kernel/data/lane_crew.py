"""The members that groups of lanes step."""

from __future__ import annotations

from dataclasses import dataclass

from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class LaneCrew(Struct):
    """Where the data of each member stand, and functions for one of them."""

    addresses = ('problem', 'phase', 'alone', 'forces', 'drives')

    problem: Addresses  # (W,) of its Problem
    phase: Addresses  # (W,) of its Phase
    alone: Addresses  # (1,) where the code of steps of one member begins
    forces: Addresses  # (1,) of the function that puts Q of one member into its work
    drives: Addresses  # (1,) of the function that places its prescribed blocks
    steady: Integers  # (1,) 1 if Q depends neither on time nor on the motion
    dated: Integers  # (1,) 1 if forces or drives have kinks over time
    result: Integers  # (W,) of the steps of each
    apart: Integers  # (W,) steps that each took alone


@dataclass(frozen=True, eq=False)
class LaneProgress(Struct):
    """How far a member is; in lanes all of them."""

    index: Floats  # (1,) number of its steps, a whole number
    target: Floats  # (1,) number of steps at which it is done
    t: Floats  # (1,) s, of the stage
    begin: Floats  # (1,) s, where its step begins
    end: Floats  # (1,) s, where it ends; of an adaptive method: where it ends at the latest
    left: Floats  # (1,) s, of its step of the grid, or to a kink over time
    most: Floats  # (1,) most iterations in one solve
    across: Floats  # (1,) 1 if a kink of the forces is in its step, of an adaptive method


@dataclass(frozen=True, eq=False)
class LaneGroups(Struct):
    """Where the data of each group stand."""

    addresses = ('problem', 'phase', 'progress', 'crew')

    problem: Addresses  # (groups,) of the Problem in lanes
    phase: Addresses  # (groups,) of the Phase in lanes
    progress: Addresses  # (groups,) of the LaneProgress in lanes
    crew: Addresses  # (groups,) of the LaneCrew

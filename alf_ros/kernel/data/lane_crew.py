"""The members that groups of lanes step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.kernel.numba_ext.structs import Struct


@dataclass(frozen=True, eq=False)
class LaneCrew(Struct):
    """Where the data of each member stand, and functions for one of them."""

    addresses = (
        *('problem', 'phase', 'alone', 'forces', 'drives', 'lane_force', 'lane_drives'),
        *('stage', 'columns'),
    )

    problem: Addresses  # (W,) of its Problem
    phase: Addresses  # (W,) of its Phase
    alone: Addresses  # (1,) where the code of steps of one member begins
    forces: Addresses  # (3,) of functions for one member: Q into its work, one effect, its side
    drives: Addresses  # (1,) of the function that places its prescribed blocks
    stage: Addresses  # (1,) of the function that evaluates a stage of it exactly
    lane_force: Addresses  # (effects,) of force() for lanes, 0: none; (0,): for each member alone
    lane_drives: Addresses  # (1,) of the function that places prescribed blocks in lanes, or (0,)
    params: Floats  # (numbers W,) of `Effects.params`, in lanes
    parted: Integers  # (1,) 0 if the members have taken the same branches
    steady: Integers  # (1,) 1 if Q depends neither on time nor on the motion
    dated: Integers  # (1,) 1 if forces or drives have kinks over time
    result: Integers  # (W,) of the steps of each
    apart: Integers  # (W,) steps that each took alone
    member: Integers  # (W,) its number among all members; -1: none
    kind: Integers  # (1,) members of groups of one kind may change places
    columns: Addresses  # (arrays,) of the numbers of the members, in lanes, but their workspaces
    sizes: Addresses  # (arrays,) how many numbers of each member


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
    alone: Floats  # (1,) 1 if a stage of it is evaluated alone
    more: Floats  # (1,) how many stages were, of steps that do not count yet
    Q: Floats  # (blocks D,) N, of the effects before one at which the members part


def progress_of(blocks: int) -> LaneProgress:
    """Of a member with so many numbers of q."""
    return LaneProgress(*[*np.zeros((10, 1)), np.zeros(blocks)])


@dataclass(frozen=True, eq=False)
class LaneGroups(Struct):
    """Where the data of each group stand."""

    addresses = ('problem', 'phase', 'progress', 'crew')

    problem: Addresses  # (groups,) of the Problem in lanes
    phase: Addresses  # (groups,) of the Phase in lanes
    progress: Addresses  # (groups,) of the LaneProgress in lanes
    crew: Addresses  # (groups,) of the LaneCrew

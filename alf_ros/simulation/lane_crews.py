"""The crew of a group of lanes: its members, and functions for all of them or for one.

Forces are computed for all members at once where they have the same effects with other numbers,
drives where they have the same program.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros import effects as registry
from alf_ros.arrays import Addresses, Floats
from alf_ros.kernel import Effects, Prescribed
from alf_ros.kernel.data.lane_crew import LaneCrew
from alf_ros.kernel.lanes.single_member import functions_of_members
from alf_ros.kernel.numba_ext.lane_structs import aligned
from alf_ros.simulation.applied import Applied


def crew_of(
    problems: Addresses,
    phases: Addresses,
    applied: Sequence[Applied],
    effects: Sequence[Effects],
    drives: Sequence[Prescribed],
    dimension: int,
    adaptive: bool,
    columns: Sequence[Floats],
    numbers: Sequence[int],
) -> LaneCrew:
    """The crew of members with these structs, forces and drives; `effects` and `drives` may have
    one for all members.

    `dimension` and `adaptive`: as of `functions_of_members`. columns: arrays (numbers, lanes) of
    what the members have in lanes. numbers (lanes,): of the members, -1 where there is none.
    """
    lanes = problems.size
    functions = functions_of_members(dimension, adaptive)
    steady = all(each.is_steady for each in applied)
    found = [] if steady else _lane_forces(applied[0].kinds, effects, lanes)
    params = effects[0].params.size if found else 0
    return LaneCrew(
        problem=problems,
        phase=phases,
        alone=functions.alone,
        forces=functions.forces,
        drives=functions.drives,
        stage=functions.stage,
        lane_force=np.array(found, dtype=np.uint64),
        lane_drives=np.array(_lane_drives(drives, lanes), dtype=np.uint64),
        params=aligned(params, lanes).ravel(),
        parted=np.zeros(1, dtype=np.int64),
        steady=np.array([steady], dtype=np.int64),
        dated=np.array([any(each.instants.size for each in applied)], dtype=np.int64),
        result=np.zeros(lanes, dtype=np.int64),
        apart=np.zeros(lanes, dtype=np.int64),
        member=np.array(numbers, dtype=np.int64),
        kind=np.zeros(1, dtype=np.int64),
        columns=np.array([each.ctypes.data for each in columns], dtype=np.uint64),
        sizes=np.array([len(each) for each in columns], dtype=np.uint64),
    )


def _lane_forces(kinds: Sequence[str], effects: Sequence[Effects], lanes: int) -> list[int]:
    """`LaneCrew.lane_force`, of effects whose first have these kinds."""
    if not all(are_alike(effects[0], each) for each in effects):
        return []
    # it teaches numba new types: only where somebody asks
    from alf_ros.effects.contract.lane_force import lane_force

    found = [lane_force(registry.load(kind).force._pyfunc, lanes) for kind in kinds]
    return found if any(found) else []


def _lane_drives(drives: Sequence[Prescribed], lanes: int) -> list[int]:
    """`LaneCrew.lane_drives`: where members have one program, with other numbers."""
    first = drives[0]
    if not first.program.size or not all(np.array_equal(first.slots, d.slots) for d in drives):
        return []
    from alf_ros.model.lane_time_program import lane_run

    return [lane_run(lanes)]


def are_alike(one: Effects, other: Effects) -> bool:
    """Whether effects have the same functions, and their numbers stand in the same places."""
    if one is other:
        return True
    names = 'force', 'side', 'slots', 'slots_at', 'params_at'
    pairs = [(getattr(one, name), getattr(other, name)) for name in names]
    return one.params.size == other.params.size and all(np.array_equal(*pair) for pair in pairs)

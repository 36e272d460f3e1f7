"""Members of later groups take the lanes of members that are done.

With an adaptive method some members take many more steps than others. A lane whose member is done
would be idle until the last one of its group is. So this member changes places with one that
waits in a later group of the same kind: all numbers of both in lanes do, and what the crews know
of them.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneGroups, LaneProgress
from alf_ros.kernel.lanes.single_member import take_params_of, take_phase
from alf_ros.kernel.numba_ext.jit import ONE, ZERO, inner
from alf_ros.kernel.numba_ext.lane_structs import lane, lanes_at, set_lane, struct_at
from alf_ros.kernel.numba_ext.structs import Lanes


@inner
def next_waiting(
    progress: LaneProgress, crew: LaneCrew, groups: LaneGroups, place: np.uint64
) -> np.uint64:
    """The first place, from this one on, of a member that waits; a place is the number of a group,
    times W, plus a lane. Behind all places if no member does. `progress`, `crew`: of the group
    that asks."""
    W = np.uint64(crew.problem.size)
    end = np.uint64(groups.crew.size) * W
    while place < end:
        g, m = place // W, place % W
        there = struct_at(progress, groups.progress[g])
        if lane(there.index, ZERO, m) < lane(there.target, ZERO, m):
            if struct_at(crew, groups.crew[g]).kind[0] == crew.kind[0]:
                break
        place += ONE
    return place


@inner
def take_waiting(
    problem: Problem,
    phase: Phase,
    progress: LaneProgress,
    crew: LaneCrew,
    of: Problem,
    of_phase: Phase,
    groups: LaneGroups,
    change: tuple[np.uint64, np.uint64],
) -> None:
    """Let the member in a lane of this group, which is done, and the one at a place change places;
    take the state of the second. change: this lane and this place."""
    m, place = change
    struct_at(of_phase, crew.phase[m]).step[0] = np.int64(lane(progress.index, ZERO, m))
    W = np.uint64(crew.problem.size)
    g, k = place // W, place % W
    other = struct_at(crew, groups.crew[g])
    there = struct_at(progress, groups.progress[g])
    for n in range(ZERO, np.uint64(crew.columns.size)):
        own = lanes_at(progress.Q, crew.columns[n], crew.sizes[n])
        _exchange(own, lanes_at(progress.Q, other.columns[n], crew.sizes[n]), m, k)
    _exchange(progress.index, there.index, m, k)
    _exchange(progress.target, there.target, m, k)
    _exchange(progress.most, there.most, m, k)
    crew.problem[m], other.problem[k] = other.problem[k], crew.problem[m]
    crew.phase[m], other.phase[k] = other.phase[k], crew.phase[m]
    crew.result[m], other.result[k] = other.result[k], crew.result[m]
    crew.apart[m], other.apart[k] = other.apart[k], crew.apart[m]
    crew.member[m], other.member[k] = other.member[k], crew.member[m]
    member = struct_at(of, crew.problem[m])
    take_phase(phase, problem.work, struct_at(of_phase, crew.phase[m]), member, m)
    take_params_of(of, crew, m)


@inner
def _exchange(one: Lanes, other: Lanes, m: np.uint64, k: np.uint64) -> None:
    """Lane m of one vector and lane k of another."""
    for i in range(ZERO, np.uint64(one.size)):
        x = lane(one, i, m)
        set_lane(one, i, m, lane(other, i, k))
        set_lane(other, i, k, x)

"""Lanes whose steps are clear of contacts and other kinks of the forces; the others take such a
step alone, in the pieces of `kinks_over_time` and `grazed_kinks`."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.kernel.arc_coordinates import unfold
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.data.lane_crew import LaneCrew, LaneProgress
from alf_ros.kernel.grazed_kinks import (
    PARTS,
    all_far,
    end_in_arcs,
    interpolate,
    keep_end,
    measure,
    restore_end,
)
from alf_ros.kernel.kinks_over_time import piece_to_kink, until_kink
from alf_ros.kernel.lanes.single_member import lane_drives, put_lane
from alf_ros.kernel.numba_ext.jit import TWO, ZERO, inner
from alf_ros.kernel.numba_ext.lane_structs import lane, set_lane, struct_at
from alf_ros.kernel.numba_ext.vectors import copy

Lanes = Any
Mask = Any


@inner
def clear_of_kinks(
    problem: Problem,
    phase: Phase,
    of: Problem,
    crew: LaneCrew,
    progress: LaneProgress,
    begin: Lanes,
    h: Lanes,
    good: Mask,
) -> Mask:
    """Where `good` holds and in the step of h (s) from `begin` (s), which ended in `work`, no
    scalar of an effect comes near an end of its interval. Overwrites `progress.t`."""
    if problem.forces.kinks.search.size == ZERO:
        return good
    unit, work, parts = problem.unit, problem.work, np.uint64(PARTS)
    keep_end(problem)
    end_in_arcs(problem, h)
    progress.t[0] = begin + h
    _measure(problem, of, crew, progress, parts)
    progress.t[0] = begin
    copy(phase.q, work.q)
    copy(phase.qd, work.qd)
    lane_drives(problem, of, crew, progress)
    _measure(problem, of, crew, progress, ZERO)
    progress.t[0] = begin + 0.5 * h
    interpolate(problem, h, 0.5, 1.0)
    lane_drives(problem, of, crew, progress)
    unfold(unit, problem.system, work, phase)
    _measure(problem, of, crew, progress, parts // TWO)
    restore_end(problem)
    progress.t[0] = h
    for m in range(ZERO, np.uint64(crew.problem.size)):
        far = all_far(struct_at(of, crew.problem[m]), lane(progress.t, ZERO, m))
        set_lane(progress.t, ZERO, m, 1.0 if far else 0.0)
    return good & (progress.t[0] > 0.0)


@inner
def clear_of_instants(of: Problem, crew: LaneCrew, progress: LaneProgress, h: float) -> Mask:
    """Where no kink over time is within the step of h (s), of which `progress` has begin and end;
    these are put onto the sides of kinks that are near. Overwrites `progress.t`."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        instants = struct_at(of, crew.problem[m]).forces.kinks.instants
        t, last = lane(progress.begin, ZERO, m), lane(progress.end, ZERO, m)
        begin, end, aim = piece_to_kink(instants, t, last, h, 0.0, h)
        set_lane(progress.begin, ZERO, m, begin)
        set_lane(progress.end, ZERO, m, end)
        set_lane(progress.t, ZERO, m, 1.0 if aim == h else 0.0)
    return progress.t[0] > 0.0


@inner
def end_at_instants(of: Problem, crew: LaneCrew, progress: LaneProgress, h: float) -> None:
    """Let steps end before kinks over time: `progress` has their begins and lengths to the next
    point of the grid of h (s). They are put onto the sides of kinks that are near, too."""
    for m in range(ZERO, np.uint64(crew.problem.size)):
        instants = struct_at(of, crew.problem[m]).forces.kinks.instants
        t, left = lane(progress.begin, ZERO, m), lane(progress.left, ZERO, m)
        left, earliest, latest = until_kink(instants, t, left, h)
        set_lane(progress.begin, ZERO, m, max(t, earliest))
        set_lane(progress.end, ZERO, m, latest)
        set_lane(progress.left, ZERO, m, left)


@inner
def _measure(
    problem: Problem, of: Problem, crew: LaneCrew, progress: LaneProgress, j: np.uint64
) -> None:
    """The scalars of each member at q and q̇ in `work`, as place j of their paths."""
    work = problem.work
    n = np.uint64(work.p.size)
    for m in range(ZERO, np.uint64(crew.problem.size)):
        member = struct_at(of, crew.problem[m])
        put_lane(work.q, member.work.q, n, m)
        put_lane(work.qd, member.work.qd, n, m)
        measure(member, lane(progress.t, ZERO, m), j)

"""How a mechanism at rest in a singular position leaves it: on which branch, and which way.

Its acceleration lacks the lost rows, so it belongs to no branch. The branches are known where a
run is set at rest (`System.departures`); elsewhere the nearest one is found by projection.

If only a part rests there, and no row connects it with what moves, speeds and distances of this
part count alone until it has left, and it is followed along its own way.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Departures, Problem, Scales, System
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest, largest, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage

SAME = 1e-11  # part of the size by which a place that is found may be off by rounding
_HERE = 1e-5  # part of the size: so near to a position its branches are those of a stage at rest
_BESIDE = 5e-3  # part of the size: so far a part that rests is followed along its own way
_TURNS = 6  # chords, at most


@inner
def rests_apart(system: System, q: Floats) -> bool:
    """Whether q (movable D,), m, is where a part of the mechanism is set at rest, or beside it."""
    ways = system.departures
    if ways.part.size == 0:
        return False
    return way_of(system, True, q, ways.q, ways.part.size) <= _BESIDE * system.size


@inner
def speed_of(system: System, apart: bool, v: Floats, n: np.uint64) -> float:
    """Largest of the first n numbers, without sign; of the part that rests, if `apart`."""
    if not apart:
        return largest(v, n)
    most, part = 0.0, system.departures.part
    for a in range(n):
        most = max(most, abs(part[a] * v[a]))
    return most


@inner
def way_of(system: System, apart: bool, q: Floats, q0: Floats, n: np.uint64) -> float:
    """Largest difference of the first n coordinates, m, likewise."""
    if not apart:
        return furthest(q, q0, n)
    most, part = 0.0, system.departures.part
    for a in range(n):
        most = max(most, abs(part[a] * (q[a] - q0[a])))
    return most


@inner
def keep_part(system: System, v: Floats) -> None:
    """v (movable D,) of the part that rests; 0 for all else."""
    part = system.departures.part
    for a in range(part.size):
        v[a] *= part[a]


@inner
def leave_on_branch(problem: Problem, apart: bool) -> bool:
    """Let `along` be the acceleration on the branch where it is nearest to the one without the
    lost rows, if branches are known, else that one; returns whether they are."""
    system, work = problem.system, problem.work
    n, ways = work.p.size, system.departures
    copy(work.pull, work.along)
    if apart:
        keep_part(system, work.along)
    if not ways.branch.size:
        return False
    if way_of(system, apart, work.base, ways.q, n) > _HERE * system.size:
        return False
    momenta = work.sum_q
    zero(momenta)
    add_mass_times(problem.unit, system.mass, 1.0, work.along, momenta)
    most, best, part, branch = 0.0, -1, 0.0, -1
    for k in range(ways.branch.size):
        if ways.branch[k] != branch:
            part, branch = 0.0, ways.branch[k]
        part += _along(ways, k, momenta) ** 2
        if part > most:
            most, best = part, branch
    zero(work.along)
    for k in range(ways.branch.size):
        if ways.branch[k] == best:
            rate, at = _along(ways, k, momenta), n * np.uint64(k)
            for a in range(n):
                work.along[a] += rate * ways.directions[at + a]
    return True


@inner
def _along(ways: Departures, k: int, momenta: Floats) -> float:
    """The part of momenta along direction k."""
    found, at = 0.0, momenta.size * np.uint64(k)
    for a in range(momenta.size):
        found += ways.directions[at + a] * momenta[a]
    return found


@inner
def meets_all(problem: Problem, gone: float, apart: bool) -> bool:
    """Whether a stage whose step has `gone` so far (m) lies on all known branches, or there
    is one branch only: then it is on the one that is followed, which interpolation between wide
    places misses by an error. A start hardly beside the position lies on its own branch."""
    ways, work = problem.system.departures, problem.work
    last = ways.branch[ways.branch.size - 1]
    return last == 0 or way_of(problem.system, apart, work.base, ways.q, work.p.size) <= gone


@inner
def follow_branch(problem: Problem, t: float, scales: Scales, spacing: float) -> int:
    """Let `along`, an acceleration from rest, be the direction of the branch next to it, and
    `curve` its curvature; returns the iterations, as `stage` does.

    The acceleration lacks the lost rows. So it may lead aside of every branch, to places that are
    no smooth function of their distance. Two of them, `spacing` (m) to either side, are projected
    onto the branch, and their chord leads along it. Where rows that hold squares bring them back
    most of the way, chords are drawn again. Without the curvature, projections would slip along
    the branch.
    """
    system, work = problem.system, problem.work
    n, most = work.p.size, 0
    speed = largest(work.along, n)
    for _turn in range(_TURNS):
        zero(work.sum_q)
        zero(work.sum_qd)
        for side in range(2):
            away = spacing / speed if side else -spacing / speed
            prescribe(system, t, work.q, work.qd, work.qdd)
            for a in range(n):
                place = work.base[a] + away * work.along[a]
                work.q[a], work.target[a] = place, place
            count, _x, _clear = stage(problem, t, scales, True, False)
            if count <= 0:
                return count
            most = max(most, count)
            for a in range(n):
                work.sum_q[a] += work.q[a] if side else -work.q[a]
                work.sum_qd[a] += work.q[a] - work.base[a]
        chord = largest(work.sum_q, n)
        if not chord > SAME * system.size:
            return most
        rate = 2.0 * speed / chord
        for a in range(n):
            work.along[a] = 0.5 * rate * work.sum_q[a]
        if chord > spacing:
            for a in range(n):
                work.curve[a] = rate * rate * work.sum_qd[a]
            return most
    return most

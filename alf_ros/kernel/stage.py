"""What an explicit method asks of a stage: q̇ and ṗ' from q and p', also at singular positions."""

from __future__ import annotations

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import OK, Forces, System, Work
from alf_ros.kernel.iteration import momentum_rate, velocities
from alf_ros.kernel.jit import inner
from alf_ros.kernel.manifold import place
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.vectors import copy, zero

SLOW = 0.1  # ratio of the augmented solve above which a stage is too close to a position
_TURN = 0.1  # part of the momentum across the free directions from which on it is, too


@inner
def stage(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    neighbour: bool,
    iterations: int,
) -> tuple[int, bool]:
    """q̇ and ṗ' of a stage from q and p' in `work`; returns iterations (0: no factor), and whether
    it is clear of singular positions."""
    n = work.p.size
    work.evaluations[0] += 1
    if place(unit, system, work, neighbour) != OK:
        return 0, False
    count, slowest = velocities(unit, system, work, iterations)
    if slowest > SLOW and not neighbour:
        copy(work.q, work.target)
        if place(unit, system, work, True) != OK:
            return 0, False
        count, slowest = velocities(unit, system, work, iterations)
    across, along = 0.0, 0.0
    for i in range(n):
        along = max(along, abs(work.p[i]))
    add_mass_times(unit, system.mass, -1.0, work.qd, work.p)
    for i in range(n):
        across = max(across, abs(work.p[i]))
    more, slower = momentum_rate(unit, system, forces, work, t, iterations)
    clear = max(slowest, slower) <= SLOW and across <= _TURN * along
    return max(count, more), clear


@inner
def stage_between(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    qd: Floats,
    spacing: float,
    iterations: int,
) -> int:
    """q̇ and ṗ' of a stage at a singular position, from three places on either side along q̇.

    The motion is smooth through the position, only its equations are not: what they give at
    ±1, ±2, ±3 times `spacing` (s) is interpolated, to sixth order. `base`, `momenta`: the stage.
    """
    n = work.p.size
    most = 0
    for _ in range(4):
        zero(work.sum_q)
        zero(work.sum_p)
        good = True
        for k in range(-3, 4):
            if k == 0:
                continue
            weight = 0.75 if abs(k) == 1 else (-0.3 if abs(k) == 2 else 0.05)
            for a in range(n):
                work.target[a] = work.base[a] + k * spacing * qd[a]
                work.q[a] = work.target[a] + 0.5 * (k * spacing) ** 2 * work.bend[a]
                work.p[a] = work.momenta[a]
            count, clear = stage(unit, system, forces, work, t, True, iterations)
            if count == 0:
                return 0
            most = max(most, count)
            good = good and clear
            for a in range(n):
                work.sum_q[a] += weight * work.qd[a]
                work.sum_p[a] += weight * work.p[a]
        if good:
            break
        spacing *= 3.0
    for a in range(n):
        work.qd[a] = work.sum_q[a]
        work.p[a] = work.sum_p[a]
    return most

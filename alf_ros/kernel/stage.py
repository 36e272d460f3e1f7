"""What an explicit method asks of a stage: q̇ and q̈ from q and p', also at singular positions."""

from __future__ import annotations

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.data import OK, Forces, Phase, System, Work
from alf_ros.kernel.iteration import accelerate, velocities
from alf_ros.kernel.jit import expanded, inner
from alf_ros.kernel.manifold import place
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.tally import tally
from alf_ros.kernel.vectors import largest, zero

_ROOM = 4.0  # how often what a stage is moved onto Φ = 0 must go into that distance
SPACING = 6.0  # of the places around a position, in parts of what is too close
_WEIGHTS = (56.0 / 70.0, -28.0 / 70.0, 8.0 / 70.0, -1.0 / 70.0)


@inner
def stage(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    radius: float,
    close: float,
    neighbour: bool,
    iterations: int,
) -> tuple[int, float, bool]:
    """q̇ and q̈ of a stage from q and p' in `work`.

    Returns iterations (0: no factor, -1: friction jams), about the distance x to a singular
    position (its least singular value over the ordinary one), and whether it is clear of it: x is
    above `close`. `radius` (m): of the path, which is what distances from a position are relative
    to.
    """
    n = work.p.size
    wholly = neighbour
    while True:
        work.evaluations[0] += 1
        if place(unit, system, work, wholly) != OK:
            return 0, 0.0, False
        count, sigma = velocities(unit, system, work, iterations, wholly)
        if sigma > 0.0 or wholly:
            more, same = accelerate(unit, system, forces, work, t, iterations, wholly)
            if more < 0:
                return more, 0.0, False
            if same > 0.0 or wholly:
                break
        wholly = True
    sigma, moved = min(sigma, same), 0.0
    for i in range(n):
        moved = max(moved, abs(work.q[i] - work.target[i]))
    x = sigma / system.ordinary
    return max(count, more), x, x > close and x * radius > _ROOM * moved


@expanded
def stage_between(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    phase: Phase,
    t: float,
    s: int,
    along: Floats,
    moving: bool,
    radius: float,
    close: float,
    spacing: float,
    iterations: int,
) -> int:
    """q̇ and q̈ of stage s at a singular position, from four places on either side of it.

    The motion is smooth through the position, only its equations are not: what they give at
    ±1, ±2, ±3, ±4 times `spacing` (m) along a direction of the branch is interpolated, to eighth
    order. `base`, `p`: the stage. Where `along` is its velocity (`moving`), what is
    prescribed is where it will be when the mechanism is there. Where one of the places is not
    clear, all are taken three times as far away, at most three times. From a standstill that
    knows no direction the stage stays.
    """
    n = work.p.size
    speed = largest(along, n)
    if not speed > 0.0:
        return 1
    most = 0
    for _ in range(4):
        zero(work.sum)
        zero(work.sum_q)
        good = True
        for k in range(-4, 5):
            if k == 0:
                continue
            weight = _WEIGHTS[abs(k) - 1]
            away = k * spacing / speed
            prescribe(system, t + away if moving else t, work.q, work.qd, work.qdd)
            for a in range(n):
                work.target[a] = work.base[a] + away * along[a]
                # a guess off Φ = 0 by less: there the rows are turned by that over the distance
                work.q[a] = work.target[a] + 0.5 * away * away * work.bend[a]
            count, _x, clear = stage(
                unit, system, forces, work, t, radius, close, True, iterations
            )
            if count <= 0:
                return count
            most = max(most, count)
            good = good and clear
            tally(forces.ledger.tally, system, forces, work, phase, t, s, weight, k > -4)
            for a in range(n):
                work.sum_q[a] += weight * work.qd[a]
                work.sum[a] += weight * work.qdd[a]
        if good:
            break
        spacing *= 3.0
    for a in range(n):
        work.qd[a] = work.sum_q[a]
        work.qdd[a] = work.sum[a]
    return most

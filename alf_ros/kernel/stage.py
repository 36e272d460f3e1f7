"""What an explicit method asks of a stage: q̇ and q̈ from q and p', also at singular positions."""

from __future__ import annotations

from alf_ros.arrays import Unit
from alf_ros.kernel.augmented_solve import accelerate, accelerate_freely, apply, velocities
from alf_ros.kernel.data import Forces, System, Work
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.projection import place
from alf_ros.kernel.status import OK

_ROOM = 4.0  # how often what a stage is moved onto Φ = 0 must go into that distance


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
    rubbing: bool,
) -> tuple[int, float, bool]:
    """q̇ and q̈ of a stage from q and p' in `work`.

    Returns iterations (0: no factor, -1: friction jams), about the distance x to a singular
    position (its least singular value over the ordinary one), and whether it is clear of it: x is
    above `close`. `radius` (m): of the path, which is what distances from a position are relative
    to. `rubbing`: with friction that depends on reactions.
    """
    n = work.p.size
    wholly = neighbour
    while True:
        work.evaluations[0] += 1
        if place(unit, system, work, wholly) != OK:
            return 0, 0.0, False
        count, sigma = velocities(unit, system, work, iterations, wholly)  # (33)
        if sigma > 0.0 or wholly:
            if rubbing:
                more, same = accelerate(unit, system, forces, work, t, iterations, wholly)  # (26)
            else:
                apply(unit, system, forces, work, t)
                more, same = accelerate_freely(unit, system, work, iterations, wholly)  # (26)
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

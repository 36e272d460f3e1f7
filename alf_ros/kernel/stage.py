"""A stage of an explicit method: q̇ and q̈ from q and p', also at singular positions."""

from __future__ import annotations

from alf_ros.kernel.augmented_solve import accelerate, accelerate_freely, apply, velocities
from alf_ros.kernel.data import Problem, Scales
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import furthest
from alf_ros.kernel.projection import project_stage
from alf_ros.kernel.status import OK
from alf_ros.kernel.stopping import told_to_stop

_CLEARANCE = 4.0  # least distance from a singular position, in parts of the way onto Φ = 0


@inner
def stage(
    problem: Problem, t: float, scales: Scales, neighbour: bool, rubbing: bool
) -> tuple[int, float, bool]:
    """q̇ and q̈ of a stage from q and p' in `work`.

    `neighbour`: the last stage was beside a singular position, so this one is expected to be
    beside it too. `rubbing`: with friction that depends on reactions. Returns iterations (0: no
    factor, or stopped; -1: no balance of friction, which rounding may hide if the stage is not
    clear), about the distance x to a singular position (its least singular value over the
    ordinary one), and whether the stage is clear of it: x is above `scales.close`, and x times
    the radius of the path well above the way that the stage was moved onto Φ = 0.
    """
    work = problem.work
    if told_to_stop(work):
        return 0, 0.0, False
    exactly = neighbour
    while True:
        work.evaluations[0] += 1
        if project_stage(problem.unit, problem.system, work, exactly) != OK:
            return 0, 0.0, False
        count, sigma = velocities(problem, exactly)  # (33)
        if sigma > 0.0 or exactly:
            if rubbing:
                more, same = accelerate(problem, t, exactly)  # (26)
            else:
                apply(problem, t)
                more, same = accelerate_freely(problem, exactly)  # (26)
            if same > 0.0 or exactly or more < 0:
                break
        exactly = True
    moved = furthest(work.q, work.target, work.p.size)
    x = (sigma if more < 0 else min(sigma, same)) / problem.system.ordinary
    clear = x > scales.close and not _CLEARANCE * moved > x * scales.radius  # also if x is inf
    return more if more < 0 else max(count, more), x, clear

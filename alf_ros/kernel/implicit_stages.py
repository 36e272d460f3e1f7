"""The stages of a step of an implicit method that was taken before, in another workspace.

Their k are known, so each stage is one evaluation. Beside a singular position no pass determines
what k changes by, so stages there are refused.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.data import Phase, Problem, Scales
from alf_ros.kernel.effect_jacobians import add_soft_times, weigh
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import THREE, inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import OK, STOPPED, UNFOLLOWED
from alf_ros.kernel.step import curve_path, evaluate_first, store_angles
from alf_ros.kernel.step_tape import store_multipliers
from alf_ros.kernel.stopping import told_to_stop

_NEAREST = 0.01  # distance x to a singular position: rounding e is e / x³ in a derivative


@inner
def evaluate_begin(problem: Problem, phase: Phase, t: float, lam: Floats) -> tuple[int, float]:
    """q̈ where a step begins, with M, and -λ into `lam`. Returns the result, and about the distance
    x to a singular position."""
    system, work = problem.system, problem.work
    zero(system.soft.weight)
    store_angles(problem.unit, system, work, phase)
    copy(phase.q, work.q)
    if not linearise(problem.unit, system, work, work.q):
        return UNFOLLOWED, 0.0
    most, felt = evaluate_first(problem, phase, t)
    if most >= 0:
        store_multipliers(lam, work.y)
        curve_path(problem)
    x = felt / system.ordinary
    return UNFOLLOWED if most < 0 or x < _NEAREST else OK, x


@inner
def evaluate_again(
    problem: Problem,
    phase: Phase,
    k: Floats,
    interval: tuple[float, float],
    s: np.uint64,
    scales: Scales,
    near: bool,
    lam: Floats,
) -> tuple[int, float]:
    """q, q̇, q̈ and factor of stage s of a step from `phase`, at its k, and -λ into `lam`.

    k and `interval` are as for `place_stage`; near: whether the stage evaluated last is beside a
    singular position. Returns the result, and about the distance x to such a position.
    """
    work = problem.work
    place_stage(problem, phase, k, interval, s)
    count, x, clear = stage(problem, interval[0], scales, near, True)
    if told_to_stop(work):
        return STOPPED, x
    if count <= 0 or not clear or x < _NEAREST:
        return UNFOLLOWED, x
    store_multipliers(lam, work.y)
    return OK, x


@inner
def place_stage(
    problem: Problem, phase: Phase, k: Floats, interval: tuple[float, float], s: np.uint64
) -> None:
    """q and p' of stage s, M̂ there, and its k, as the step left them in k (stages, 3, n).

    `interval`: s, when it is, and the length of the step.
    """
    t, h = interval
    unit, system, method, work = problem.unit, problem.system, problem.method, problem.work
    n, stages = work.p.size, method.b.size
    for i in range(n):
        q, v = 0.0, 0.0
        for m in range(s):
            weight = method.a[s * stages + m]
            q += weight * k[THREE * m * n + i]
            v += weight * k[THREE * m * n + n + i]
        gamma = h * method.a[s * stages + s]
        system.soft.k[i] = k[THREE * s * n + n + i]
        work.qd[i] = phase.qd[i] + h * v + gamma * system.soft.k[i]
        work.q[i] = phase.q[i] + h * q + gamma * work.qd[i]
    prescribe(system, t, work.q, work.qd, work.qdd)
    weigh(unit, system, problem.forces, work, t, h * method.a[s * stages + s])
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.qd, work.p)
    add_soft_times(unit, system.soft, 1.0, work.qd, work.p)  # (30) with M̂
    copy(work.q, work.base)
    copy(work.q, work.target)

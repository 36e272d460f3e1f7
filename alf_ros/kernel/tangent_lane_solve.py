"""Solves of tangents: M x + Φ_qᵀ y = f, Φ_q x = -c of a group of parameters at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.kernel.augmented_residuals import residuals, update_rows
from alf_ros.kernel.augmented_solve import NOISE, solved_anew, turned
from alf_ros.kernel.data import NOTHING, SOLVED, FollowedStage, Problem, System, Tangents
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import everywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.lane_structs import lane, lanes_of, set_lane
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import largest, zero
from alf_ros.kernel.triangular_solve import step_by

Mask = Any  # a truth value for each lane

# what is done about slow modes; no truth values, each of which would be compiled for itself
LEAVE, FINISH = np.uint64(0), np.uint64(1)
# what f is: M x of the x on entry, or what stands in `Tangents.f`
ALONG_MASS, UNDER_FORCES = np.uint64(0), np.uint64(1)


@inner
def solved_together(
    tangents: Tangents,
    problem: Problem,
    at: FollowedStage,
    x: Lanes,
    slow_modes: np.uint64,
    forces: np.uint64,
    before: Lanes,
) -> bool:
    """x (all blocks D,) for the f that `forces` says, in `tangents`.

    The right-hand side of the first δ, r2 = -c - Φ_q x and y = 0 stand in `at`, a stage of
    `problem`. before: the largest of r2, rows scaled to lengths, or infinite if it is not small.
    Returns whether no lane is left in which a mode is slow.

    All lanes iterate as `augmented_solve.iterate` does, and end where it ends. If
    `slow_modes` is FINISH, a lane with a slow mode is finished by itself, with the workspace of
    `problem`. If it is LEAVE, no mode is expected to be slow, and rows are not looked at after a
    round that is certain to close them.
    """
    unit, system, f = problem.unit, problem.system, tangents.f
    root = np.sqrt(system.penalty)
    fine = max(SOLVED, NOISE * root)
    before *= root
    # a projection mostly takes one round, and other solves two: how the first one of these ended
    # is judged only if that is not all
    first_step, first_size = step_by(unit, system, at, x)  # A δ = …, x += δ: (26), (33)
    first_step *= system.rounding
    first_own = max(first_size, NOTHING)
    if slow_modes == LEAVE and forces == ALONG_MASS:
        if everywhere(_are_last(system, fine, before, first_step, first_own)):
            return True
    before = root * update_rows(unit, system.rows, at)
    if forces == ALONG_MASS:
        if everywhere((before <= fine * first_own) & (first_step <= SOLVED * first_own)):
            return True
        zero(f)
        add_mass_times(unit, system.mass, 1.0, x, f)
        add_mass_times(unit, system.mass, -1.0, at.delta, f)
        if system.soft.weight.size > 0:
            add_soft_times(unit, system.soft, 1.0, x, f)
            add_soft_times(unit, system.soft, -1.0, at.delta, f)
    residuals(unit, system, at, f, x)
    step, size = step_by(unit, system, at, x)
    step *= system.rounding
    # mostly the size of x decides already
    if slow_modes == LEAVE and everywhere(_are_last(system, fine, before, step, size)):
        return True
    left = root * update_rows(unit, system.rows, at)
    if everywhere((left <= fine * size) & (step <= SOLVED * size)):
        return True
    first = before, first_step, first_own
    return _go_on(tangents, problem, at, x, slow_modes, first, (left, step, size))


@inner
def _go_on(
    tangents: Tangents,
    problem: Problem,
    at: FollowedStage,
    x: Lanes,
    slow_modes: np.uint64,
    first: tuple[Lanes, Lanes, Lanes],
    second: tuple[Lanes, Lanes, Lanes],
) -> bool:
    """`solved_together` behind its second round.

    first, second: the rows that a round left open, its step, and the size of x behind it.
    """
    before, first_step, first_own = first
    left, step, size = second
    unit, system, f = problem.unit, problem.system, tangents.f
    root, iterations = np.sqrt(system.penalty), problem.method.iterations
    fine = max(SOLVED, NOISE * root)
    alone = max(largest(f, at.work.p.size) / system.mean, NOTHING)
    usual = max(size, alone)
    first_usual = max(first_own, alone)
    going = unless((before <= fine * first_usual) & (first_step <= SOLVED * first_usual))
    slowest = 0.0 * at.delta[0]
    for count in range(2, iterations + 1):
        if count > 2:
            residuals(unit, system, at, f, x)
            step, size = step_by(unit, system, at, x)
            step *= system.rounding
            usual = max(size, alone)
            if slow_modes == LEAVE and nowhere(
                going & unless(_are_last(system, fine, before, step, usual))
            ):
                break
            left = root * update_rows(unit, system.rows, at)
        closed = left <= fine * usual
        ended = closed & (step <= SOLVED * usual)
        if not everywhere(closed):
            slow = going & unless(closed)
            ratio = min(1.0, left / pick(slow, before, 1.0))
            if count == 2 and iterations != 2:
                slow = slow & (ratio <= system.patience)
            bound = fine * usual * turned(system, at.work, system.ordinary)
            rounded = (ratio > system.patience) & (left <= bound)
            ended = ended | (slow & rounded)
            slow = slow & unless(rounded)
            slowest = pick(slow, max(slowest, ratio), slowest)
            ended = ended | (slowest > system.patience)
        going = going & unless(ended)
        if nowhere(going):
            break
        before = left
    slow = slowest > system.patience
    if nowhere(slow):
        return True
    if slow_modes == LEAVE:
        return False
    for m in range(lanes_of(x)):
        _finish(tangents, problem, at, x, m)
    return True


@inlined
def _are_last(system: System, fine: float, before: Lanes, step: Lanes, own: Lanes) -> Mask:
    """In which lanes a round is certain to close the rows: it leaves a part `patience` of r2 at
    most, unless a mode is slow."""
    return (system.patience * before <= fine * own) & (step <= SOLVED * own)


@inner
def _finish(
    tangents: Tangents, problem: Problem, at: FollowedStage, x: Lanes, m: np.uint64
) -> None:
    """Continue with lane m alone."""
    work, f, alone = problem.work, tangents.lane_f, tangents.lane_x
    for a in range(alone.size):
        f[a], alone[a] = lane(tangents.f, a, m), lane(x, a, m)
    for r in range(work.r2.size):
        work.r2[r], work.y[r] = lane(at.r2, r, m), lane(at.y, r, m)
    solved_anew(problem, f, alone, True)
    for a in range(alone.size):
        set_lane(x, a, m, alone[a])

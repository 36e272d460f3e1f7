"""The derivatives of q and q̇ by parameters, carried through an accepted step.

The variational equation of the motion is integrated by the method of the step, at its stages. In
each stage δq̈ follows from δq and δq̇ by a solve with the factor of that stage (`tangent_stage`,
`tangent_solves`). Lengths of steps are not differentiated: they are numbers of the method.

Mostly the tangents follow the stages as the step takes them (`tangent_follow`). If a stage is
beside a singular position, the step is taken again, from the state where it began: all its stages
are projected then, and those beside the position interpolated (`tangent_stage`). An adjoint takes
each step again, to write its stages on a tape.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.arc_coordinates import (
    begin_momenta,
    choose_arcs,
    fold,
    shift_along_path,
    unfold,
)
from alf_ros.kernel.augmented_solve import accelerate
from alf_ros.kernel.companion import (
    ADDED_UP,
    BEGIN_CALL,
    BEGIN_STEP,
    END_STEP,
    FIRST_STAGE,
    STAGE,
    told,
)
from alf_ros.kernel.data import Phase, Problem, Tangents, Tape
from alf_ros.kernel.interpolated_stages import evaluate_interpolated
from alf_ros.kernel.kinks_over_time import stage_time
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, by_address, inner
from alf_ros.kernel.numba_ext.vectors import copy, furthest
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.scales import scales_of
from alf_ros.kernel.stage import stage
from alf_ros.kernel.status import OK, STOPPED, UNFOLLOWED
from alf_ros.kernel.step import add_up, curve_path, evaluate_first, store_angles
from alf_ros.kernel.step_tape import (
    PROJECTED,
    REGULAR,
    is_beside,
    store_axes,
    store_multipliers,
    store_stage,
)
from alf_ros.kernel.stopping import told_to_stop
from alf_ros.kernel.tangent_arcs import adds_arcs
from alf_ros.kernel.tangent_axes import (
    accept_tangents,
    begin_tangents,
    fold_tangents,
    read_tangents,
    unfold_tangents,
)
from alf_ros.kernel.tangent_follow import (
    begin_following,
    follow_stage,
    follow_sums,
    is_followed,
)
from alf_ros.kernel.tangent_lane_solve import FINISH, LEAVE
from alf_ros.kernel.tangent_stage import (
    differentiate,
    differentiate_beside,
    differentiate_projected,
    project_tangents,
)


def _follow(
    tangents: Tangents,
    problem: Problem,
    phase: Phase,
    what: np.uint64,
    s: np.uint64,
    t: float,
    x: float,
) -> int:
    """The companion of the steps of an explicit method."""
    if what == BEGIN_CALL:
        read_tangents(tangents, phase)
    elif what == FIRST_STAGE:
        store_multipliers(tangents.lam, problem.work.y)
    elif what == BEGIN_STEP:
        begin_following(tangents, problem, phase, s > 0)
    elif what == STAGE:
        follow_stage(tangents, problem, t, s, x)
    elif what == ADDED_UP:
        unfold_tangents(tangents, problem, t, s, problem.work.interval[TWO])
    elif what == END_STEP:
        return _carry(tangents, problem, phase, x)
    return OK


@cache
def following(dimension: int, lanes: int) -> Any:
    """The compiled function for 2 or 3 dimensions and tangents in so many lanes; its `address` is
    what `Work` holds."""
    tangents = Tangents._numba_type(dimension, lanes)
    return by_address(told(tangents, dimension))(_follow)


@inner
def _carry(tangents: Tangents, problem: Problem, phase: Phase, sigma: float) -> int:
    """The tangents of `phase`, where a step of `problem` began, to its end.

    The step ended in the workspace of `problem`, with Φ_q and factor; `sigma` as of `step`.
    Returns the result; if it is not OK the tangents are as before.
    """
    work = problem.work
    near = is_beside(work, work.nearest[0]) or tangents.followed[0] == 0
    if is_followed(tangents) and not near:
        if project_tangents(tangents, problem, tangents.here, LEAVE):
            return accept_tangents(tangents, problem, phase)
    ended = work.q, work.qd, work.sigma
    interval = work.interval[ZERO], work.interval[ONE], work.interval[TWO]
    result = carry_again(tangents, phase, ended, near, interval, sigma)
    return accept_tangents(tangents, problem, phase) if result == OK else result


@inner
def carry_again(
    tangents: Tangents,
    phase: Phase,
    ended: tuple[Floats, Floats, Floats],
    near: bool,
    interval: tuple[float, float, float],
    sigma: float,
    tape: Tape | None = None,
) -> int:
    """δq and δq̇ of the end of a step, which is taken again.

    `ended`: q, q̇ and σ there; `near`: that, or a stage, is beside a singular position; `interval`:
    begin, end and length, s; `tape`: its stages are written there.
    """
    t, end, h = interval
    ended_q, ended_qd, ended_sigma = ended
    problem, at = tangents.problem, tangents.behind
    unit, system, method, work = problem.unit, problem.system, problem.method, problem.work
    store_angles(unit, system, work, phase)
    copy(phase.q, work.q)
    if not linearise(unit, system, work, work.q):
        return UNFOLLOWED
    most, felt = evaluate_first(problem, phase, t)
    if most < 0:
        return UNFOLLOWED
    store_multipliers(tangents.lam, work.y)
    curve_path(problem)
    x = min(sigma, felt) / system.ordinary
    scales = scales_of(system, work, phase, False)
    begin_momenta(unit, system, work, phase, choose_arcs(unit, system, work, phase, h))
    begin_tangents(tangents, problem, phase, near)
    stages = method.b.size
    for s in range(stages):
        add_up(method, work, s, h)
        ts = stage_time(t, end, h, method.c[s])
        prescribe(system, ts, work.q, work.qd, work.qdd)
        unfold(unit, system, work, phase)
        copy(work.q, work.base)
        if s == 0:
            count, clear = 1, x > scales.close
            if x < np.inf:
                count, _ = accelerate(problem, ts, True)  # (26)
        else:
            shift_along_path(unit, system.arms, work, h * h * method.lag[s])
            # as if beside the position in all of a step near it: mostly a stage is left off Φ = 0
            # by what a motion does not feel, but q̈ across the branch has it over x, and with a
            # mass that changes so has δq̈ along it
            count, x, clear = stage(problem, ts, scales, x < np.inf or near, True)
        if not clear and count != 0:
            moved = furthest(work.q, work.base, work.p.size)
            _unfold_again(problem, phase, ts, s, h)
            count = evaluate_interpolated(problem, phase, ts, s, moved, scales)
        if count > 0:
            if s == 0:
                copy(work.qdd, work.chart.first)
            fold(unit, system, work, work.qd, work.qdd, s)
            follow_sums(tangents, problem, ts, s, h)
            kind = PROJECTED if near else REGULAR
            if tape is not None:
                store_axes(tape, work, s)
            if s > 0 or x < np.inf:
                store_multipliers(tangents.lam, work.y)
            if x < np.inf:
                if adds_arcs(tangents):
                    return UNFOLLOWED
                copy(work.q, work.sum_q)
                copy(work.qd, work.sum_qd)
                _unfold_again(problem, phase, ts, s, h)
                count, kind = differentiate_beside(tangents, phase, ts, scales, clear)
            elif near:
                count = differentiate_projected(tangents, ts)
            else:
                if s > 0 and adds_arcs(tangents):
                    project_tangents(tangents, problem, at, FINISH)
                differentiate(tangents, problem, at, ts, LEAVE)
            if tape is not None:
                store_stage(tape, tangents, s, kind)
        if told_to_stop(work):
            return STOPPED
        if count <= 0:
            return UNFOLLOWED
        fold_tangents(tangents, problem, s)
    add_up(method, work, stages, h)
    prescribe(system, end, work.q, work.qd, work.qdd)
    unfold(unit, system, work, phase)
    unfold_tangents(tangents, problem, end, stages, h)
    if tape is not None:
        store_axes(tape, work, stages)
        tape.projected[0] = 1 if not near or x == np.inf else 0
    copy(ended_q, work.q)
    copy(ended_qd, work.qd)
    copy(ended_sigma, work.sigma)
    if not near or x == np.inf:  # the end is clear of singular positions
        if not linearise(unit, system, work, work.q):
            return UNFOLLOWED
        project_tangents(tangents, problem, at, FINISH)
    return OK


@inner
def _unfold_again(problem: Problem, phase: Phase, t: float, s: np.uint64, h: float) -> None:
    """q and p of stage s as the step adds them up, and the direction of the branch there."""
    work = problem.work
    add_up(problem.method, work, s, h)
    prescribe(problem.system, t, work.q, work.qd, work.qdd)
    unfold(problem.unit, problem.system, work, phase)
    copy(work.q, work.base)
    copy(work.qd, work.along)

"""R(N) as a linear function: the reactions without friction, and the response to each load."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.applied_forces import add_friction
from alf_ros.kernel.augmented_solve import solved_anew
from alf_ros.kernel.data import Bearings, Problem
from alf_ros.kernel.numba_ext.block import block, put
from alf_ros.kernel.numba_ext.jit import ONE, inner
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.reaction_friction.cut_reactions import reactions


@inner
def _is_reaction(cut: Bearings, m: int) -> bool:
    """Whether load m is a reaction."""
    shared = cut.first[m + ONE] > cut.first[m]
    return bool(shared or cut.first_entry[m + ONE] > cut.first_entry[m])


@inner
def unit_friction(problem: Problem, t: float, m: int) -> bool:
    """Q = the friction under a load m of 1 N, which goes into `next`; returns whether there is
    any."""
    work, cut = problem.work, problem.forces.bearings
    zero(cut.next)
    zero(work.Q)
    if _is_reaction(cut, m):
        cut.next[m] = 1.0
        add_friction(problem.forces.effects, t, work.q, work.qd, work.near, cut.next, work.Q)
    return largest(work.Q, work.p.size) > 0.0


@inner
def respond(problem: Problem, t: float, exactly: bool) -> bool:
    """R(N): `response` to each load, and `reaction` without friction.

    A solve under the trial loads stands in `work`. Returns False where a solve is slow and not
    to be finished, see `solved`.
    """
    unit, work = problem.unit, problem.work
    cut, fine = problem.forces.bearings, True
    loads = np.int64(cut.trial.size)
    copy(work.y, cut.kept_y)
    copy(work.r2, cut.kept_r2)
    zero(cut.response)
    for m in range(loads):
        if fine and unit_friction(problem, t, m):
            zero(cut.qdd_of)
            zero(work.y)
            zero(work.r2)
            _, sigma = solved_anew(problem, work.Q, cut.qdd_of, exactly)  # (26)
            fine = sigma > 0.0 or exactly
            reactions(problem, t, cut.qdd_of, cut.next, False)
            for n in range(loads):
                put(cut.response, m * loads + n, block(unit, cut.reaction, n))
    copy(cut.kept_y, work.y)
    copy(cut.kept_r2, work.r2)
    reactions(problem, t, work.qdd, cut.trial, True)
    subtract_friction(problem)
    return fine


@inner
def subtract_friction(problem: Problem) -> None:
    """`reaction` -= the response to the trial loads."""
    unit, cut = problem.unit, problem.forces.bearings
    loads = np.int64(cut.trial.size)
    for n in range(loads):
        R = block(unit, cut.reaction, n)
        for m in range(loads):
            R = R - cut.trial[m] * block(unit, cut.response, m * loads + n)
        put(cut.reaction, n, R)

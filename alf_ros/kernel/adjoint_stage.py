"""Stages of tangents (`tangent_stage`), transposed."""

from __future__ import annotations

import numpy as np

from alf_ros.kernel.adjoint_forces import take_forces_back
from alf_ros.kernel.adjoint_solves import (
    accelerate_back,
    project_position_back,
    project_velocity_back,
    velocity_of_momentum_back,
)
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.driven_tangents import take_drives_back
from alf_ros.kernel.interpolated_stages import evaluate_place, place_at
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.prescribed import prescribe
from alf_ros.kernel.step_tape import (
    INTERPOLATED,
    PROJECTED,
    restore_recorded,
    restore_stage,
    store_multipliers,
)
from alf_ros.kernel.support_places import PLACES, apart
from alf_ros.kernel.tangent_arcs import adds_arcs


@inner
def take_stage_back(adjoint: Adjoint, t: float, k: np.uint64, s: np.uint64) -> int:
    """∂J/∂(δq, δq̇, δq̈) of stage s of step k, in `q`, `qd` and `qdd`, into ∂J/∂(δq, δq̇) as the step
    adds them up, in `q` and `qd`. 0 or less if it is not determined."""
    problem, stages = adjoint.tangents.problem, adjoint.tape.kind.size
    if adjoint.record.regular[k] != 0:
        restore_recorded(adjoint.record, adjoint.tangents, stages, k, s)
    else:
        restore_stage(adjoint.tape, adjoint.tangents, s)
    if adjoint.tape.kind[s] == INTERPOLATED:
        return _take_places_back(adjoint, t)
    if not linearise(problem.unit, problem.system, problem.work, problem.work.q):
        return 0
    if accelerate_back(adjoint) <= 0:
        return 0
    if take_forces_back(adjoint, t, adjoint.u, adjoint.q, adjoint.qd) <= 0:
        return -1
    if adjoint.tape.kind[s] == PROJECTED or (s > 0 and adds_arcs(adjoint.tangents)):
        return take_projections_back(adjoint)
    return 1


@inner
def take_projections_back(adjoint: Adjoint) -> int:
    """∂J/∂(δq, δq̇) behind their projections, in `q` and `qd`, into that before them, or into
    ∂J/∂(δq, δp), with the factor and Φ_q in `work`."""
    if adds_arcs(adjoint.tangents):
        count = velocity_of_momentum_back(adjoint)
    else:
        count = project_velocity_back(adjoint)
    return project_position_back(adjoint) if count > 0 else count


@inner
def _take_places_back(adjoint: Adjoint, t: float) -> int:
    """The same of a stage that is interpolated from the support positions in `work`."""
    problem = adjoint.tangents.problem
    unit, system, work = problem.unit, problem.system, problem.work
    n, whole, places = work.p.size, work.q.size, np.uint64(PLACES)
    copy(adjoint.q, adjoint.whole_q)
    copy(adjoint.qd, adjoint.whole_qd)
    copy(adjoint.qdd, adjoint.whole_qdd)
    zero(adjoint.begun_q)
    zero(adjoint.begun_qd)
    zero(adjoint.pushed)
    # δq̈ at the places
    for p in range(places):
        if evaluate_place(problem, t, p) <= 0:
            return 0
        store_multipliers(adjoint.tangents.lam, work.y)
        zero(adjoint.q)
        zero(adjoint.qd)
        zero(adjoint.qdd)
        for a in range(n):
            adjoint.qdd[a] = work.place_weights[p] * adjoint.whole_qdd[a]
        if accelerate_back(adjoint) <= 0:
            return 0
        for a in range(n):
            adjoint.pushed[a] += adjoint.u[a]
        if take_projections_back(adjoint) <= 0:
            return 0
        take_drives_back(adjoint, t + work.place_step[0] * apart(work, p))
        _add_begun(adjoint)
    # δQ at the stage
    prescribe(system, t, work.q, work.qd, work.qdd)
    for a in range(n):
        work.q[a], work.qd[a] = work.sum_q[a], work.sum_qd[a]
    if take_forces_back(adjoint, t, adjoint.pushed, adjoint.whole_q, adjoint.whole_qd) <= 0:
        return -1
    # δq and δq̇ at the places
    for p in range(places):
        place_at(problem, t, p)
        if not linearise(unit, system, work, work.q):
            return 0
        zero(adjoint.q)
        zero(adjoint.qd)
        zero(adjoint.qdd)
        for a in range(n):
            adjoint.q[a] = work.place_weights[p] * adjoint.whole_q[a]
            adjoint.qd[a] = work.place_weights[p] * adjoint.whole_qd[a]
        if take_projections_back(adjoint) <= 0:
            return 0
        take_drives_back(adjoint, t + work.place_step[0] * apart(work, p))
        _add_begun(adjoint)
    for a in range(n, whole):  # fixed and prescribed blocks are not interpolated
        adjoint.begun_q[a] += adjoint.whole_q[a]
        adjoint.begun_qd[a] += adjoint.whole_qd[a]
        adjoint.qdd[a] = adjoint.whole_qdd[a]
    copy(adjoint.begun_q, adjoint.q)
    copy(adjoint.begun_qd, adjoint.qd)
    return 1


@inner
def _add_begun(adjoint: Adjoint) -> None:
    for a in range(adjoint.q.size):
        adjoint.begun_q[a] += adjoint.q[a]
        adjoint.begun_qd[a] += adjoint.qd[a]

"""Augmented solves of a group: a lane whose solve is finished keeps its solution."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.augmented_residuals import (
    begin_accelerations,
    begin_velocities,
    residuals,
    update_rows,
)
from alf_ros.kernel.augmented_solve import NOISE, turned
from alf_ros.kernel.data import NOTHING, SOLVED, Problem, System, Until, Work
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.lane_numbers import nowhere, pick, unless
from alf_ros.kernel.numba_ext.vectors import copy, largest
from alf_ros.kernel.triangular_solve import step_by

Lanes = Any  # a number of each lane
Mask = Any  # a truth value of each lane


@inner
def augmented_lanes(
    unit: Unit, system: System, work: Work, f: Floats, x: Floats, until: Until, live: Mask
) -> tuple[Lanes, Lanes]:
    """`augmented_solve.augmented`, begun, of the lanes where `live` holds; returns rounds and
    ratio of each."""
    n, iterations, tolerance = work.p.size, until.iterations, until.tolerance
    alone = largest(f, n) / system.mean
    fine = max(tolerance, NOISE * np.sqrt(system.penalty))
    slowest = before = pick(live, 0.0, 0.0)
    rounds, going, kept = slowest + iterations, live, live & unless(live)
    for count in range(1, iterations + 1):
        if count > 1:
            residuals(unit, system, work, f, x)
        step, size = step_by(unit, system, work, x)  # A δ = …, x += δ: (26), (33)
        size = max(max(size, alone), NOTHING)
        left = np.sqrt(system.penalty) * update_rows(unit, system.rows, work)
        closed = left <= fine * size
        ended = closed & (system.rounding * step <= tolerance * size)
        if count > 1:
            slow = unless(closed) & going
            ratio = min(1.0, left / before)
            counts = slow if count != 2 or iterations == 2 else slow & (ratio <= until.patience)
            steep = counts & (ratio > until.patience)
            if not nowhere(steep):  # what rounding leaves of dependent rows is no slow mode
                rounded = steep & (left <= fine * size * turned(system, work, system.ordinary))
                counts, ended = counts & unless(rounded), ended | rounded
            slowest = pick(counts, max(slowest, ratio), slowest)
            ended = ended | (slow & (slowest > until.patience))
        ended = ended & going
        rounds = pick(ended, count, rounds)
        going = going & unless(ended)
        if nowhere(going):
            break
        if not nowhere(ended):
            kept = kept | ended
            for i in range(n):
                work.base[i] = pick(ended, x[i], work.base[i])
        before = left
    if not nowhere(kept):
        for i in range(n):
            x[i] = pick(kept, work.base[i], x[i])
    return rounds, slowest


@inner
def lane_velocities(problem: Problem, live: Mask) -> tuple[Lanes, Mask]:
    """q̇ from the momenta p' (33). Returns the rounds, and the lanes where that was not slow."""
    unit, system, work = problem.unit, problem.system, problem.work
    begin_velocities(unit, system, work)
    until = Until(np.int64(problem.method.iterations), SOLVED, system.patience)
    rounds, slowest = augmented_lanes(unit, system, work, work.p, work.qd, until, live)  # (33)
    return rounds, live & (slowest <= system.patience)


@inner
def lane_accelerations(problem: Problem, live: Mask) -> tuple[Lanes, Mask]:
    """q̈ under the Q in `work`, from a cold start (26). Returns what `lane_velocities` does."""
    unit, system, work = problem.unit, problem.system, problem.work
    for i in range(work.p.size):
        work.qdd[i] = 0.0
    begin_accelerations(unit, system, work, work.Q)
    until = Until(np.int64(problem.method.iterations), SOLVED, system.patience)
    rounds, slowest = augmented_lanes(unit, system, work, work.Q, work.qdd, until, live)  # (26)
    return rounds, live & (slowest <= system.patience)


@inner
def path_curvature(problem: Problem, live: Mask) -> None:
    """The q̈ of the unforced mechanism, into `bend`."""
    unit, system, work = problem.unit, problem.system, problem.work
    copy(work.qdd, work.bend)  # of prescribed motions
    for i in range(work.p.size):
        work.bend[i], work.p[i] = 0.0, 0.0
    begin_accelerations(unit, system, work, work.p)
    until = Until(np.int64(problem.method.iterations), 1e-3, 1.0)
    augmented_lanes(unit, system, work, work.p, work.bend, until, live)  # (26) with Q = 0


@inner
def are_factored(unit: Unit, work: Work) -> Mask:
    """The lanes whose A was positive definite: reciprocal pivots are positive numbers."""
    D, diagonal = np.uint64(len(unit)), work.diagonal
    good = diagonal[np.uint64(0)] > 0.0
    for i in range(np.uint64(0), work.p.size):
        pivot = diagonal[i * D + i % D]
        good = good & (pivot > 0.0) & (pivot < np.inf)
    return good

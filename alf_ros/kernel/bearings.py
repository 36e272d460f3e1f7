"""Friction under the reactions that it changes itself.

The effort of a joint that rubs depends on its reaction N(q̈, λ), which comes out of the solve that
needs the effort: N = G(N). Each pass of the fixed point is a solve that goes on from the last one,
with the same factor: one or two iterations. It contracts as μ r |∂N/∂τ|; Anderson's mixing of the
last passes finds it too where that is large, for all but the norm is linear in the efforts.

It is reached through its address, so that who has no such friction compiles none of this.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import cfunc, types

from alf_ros.arrays import Unit
from alf_ros.kernel.block import block, dot, packed, put
from alf_ros.kernel.constraints import add_transposed, jacobian
from alf_ros.kernel.data import ONE, Bearings, Forces, System, Work
from alf_ros.kernel.forces import add_friction, applied_forces
from alf_ros.kernel.iteration import solved
from alf_ros.kernel.jit import inner
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.vectors import copy, zero

MEMORY = 5  # passes that are mixed, at most
_PASSES = 60
_AGREED = 1e-12  # part of the largest load to which both sides agree
_ENOUGH = 1e-8  # the same, where rounding does not let them come closer


@inner
def _reactions(unit: Unit, forces: Forces, work: Work, t: float) -> None:
    """answer = |R| of each loaded joint, from q̈ and λ in `work` and the trial loads."""
    cut = forces.bearings
    for b in range(cut.source.size):
        put(cut.qdd, b, block(unit, work.qdd, cut.source[b]))
    for r in range(cut.source_row.size):
        cut.y[r] = work.y[cut.source_row[r]]
    zero(cut.needed)
    add_friction(cut.effects, t, cut.q, cut.qd, work.near, cut.trial, cut.needed)
    for i in range(cut.needed.size):
        cut.needed[i] = -cut.Q[i] - cut.needed[i]
    add_mass_times(unit, cut.mass, 1.0, cut.qdd, cut.needed)
    add_transposed(unit, cut.rows, cut.g, cut.g2, cut.y, cut.needed)
    for n in range(cut.answer.size):
        R = packed(unit, 0.0, 0.0, 0.0)
        for m in range(cut.first[n], cut.first[n + ONE]):
            R = R + cut.sign[m] * block(unit, cut.needed, cut.block[m])
        for m in range(cut.first_entry[n], cut.first_entry[n + ONE]):
            R = R - work.y[cut.entry_row[m]] * block(unit, cut.g2, cut.entry[m])
        cut.answer[n] = np.sqrt(dot(R, R))


@inner
def _place(unit: Unit, forces: Forces, work: Work, t: float) -> None:
    """The cut mechanism where the assembled one is."""
    cut = forces.bearings
    for b in range(cut.source.size):
        put(cut.q, b, block(unit, work.q, cut.source[b]))
        put(cut.qd, b, block(unit, work.qd, cut.source[b]))
    jacobian(unit, cut.rows, cut.q, cut.g, cut.g2)
    applied_forces(cut.effects, t, cut.q, cut.qd, work.near, cut.Q)


@inner
def _mixed(cut: Bearings, count: int) -> None:
    """The next trial loads, by Anderson's mixing of what `count` passes have told."""
    loads, room = np.int64(cut.trial.size), np.int64(cut.mix.size)
    memory = count - 1 if count - 1 < room else room
    for i in range(memory):  # normal equations: few unknowns, and a rough answer will do
        for j in range(i + 1):
            total = 0.0
            for n in range(loads):
                total += cut.past_gap[i * loads + n] * cut.past_gap[j * loads + n]
            cut.gram[i * room + j] = total
        total = 0.0
        for n in range(loads):
            total += cut.past_gap[i * loads + n] * (cut.answer[n] - cut.trial[n])
        cut.mix[i] = total
    for i in range(memory):  # Cholesky; what says nothing new is left out
        for j in range(i + 1):
            total = cut.gram[i * room + j]
            for m in range(j):
                total -= cut.gram[i * room + m] * cut.gram[j * room + m]
            if i > j:
                pivot = cut.gram[j * room + j]
                cut.gram[i * room + j] = total / pivot if pivot > 0.0 else 0.0
            else:
                whole = cut.gram[i * room + i]
                good = total > 1e-14 * whole
                cut.gram[i * room + i] = np.sqrt(total) if good else 0.0
        pivot = cut.gram[i * room + i]
        total = cut.mix[i]
        for m in range(i):
            total -= cut.gram[i * room + m] * cut.mix[m]
        cut.mix[i] = total / pivot if pivot > 0.0 else 0.0
    for back in range(memory):
        i = memory - 1 - back
        total = cut.mix[i]
        for m in range(i + 1, memory):
            total -= cut.gram[m * room + i] * cut.mix[m]
        pivot = cut.gram[i * room + i]
        cut.mix[i] = total / pivot if pivot > 0.0 else 0.0
    for n in range(loads):
        value = cut.answer[n]
        for i in range(memory):
            past = cut.past_trial[i * loads + n] + cut.past_gap[i * loads + n]
            value -= cut.mix[i] * past
        cut.loads[n] = max(value, 0.0)


@inner
def _settled(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    exactly: bool,
) -> tuple[int, float]:
    """Solve for q̈, λ and the loads; Q of what does not depend on them stands in `work`.

    Returns what `solved` does; -1 iterations if the loads were not found.
    """
    cut = forces.bearings
    loads, room = np.int64(cut.trial.size), np.int64(cut.mix.size)
    copy(work.Q, cut.given)
    _place(unit, forces, work, t)
    zero(cut.trial)
    most = 0
    for count in range(1, _PASSES + 1):
        copy(cut.given, work.Q)
        add_friction(forces.effects, t, work.q, work.qd, work.near, cut.trial, work.Q)
        iterated, sigma = solved(unit, system, work, work.Q, work.qdd, iterations, exactly, False)
        most = max(most, iterated)
        if sigma == 0.0 and not exactly:
            return most, sigma
        _reactions(unit, forces, work, t)
        gap, size = 0.0, 0.0
        for n in range(loads):
            gap = max(gap, abs(cut.answer[n] - cut.trial[n]))
            size = max(size, cut.answer[n])
        if gap <= _AGREED * size or (count > _PASSES // 2 and gap <= _ENOUGH * size):
            copy(cut.trial, cut.loads)
            cut.passes[0] = count
            return most, sigma
        if not np.isfinite(gap):
            break
        # differences to the last pass, in the place of the oldest
        if count > 1:
            at = ((count - 2) % room) * loads
            for n in range(loads):
                cut.past_trial[at + n] += cut.trial[n]
                cut.past_gap[at + n] += cut.answer[n] - cut.trial[n]
        _mixed(cut, count)
        at = ((count - 1) % room) * loads
        for n in range(loads):
            cut.past_trial[at + n] = -cut.trial[n]
            cut.past_gap[at + n] = -(cut.answer[n] - cut.trial[n])
        copy(cut.loads, cut.trial)
    return -1, 0.0


def _in_plane(
    system: System, forces: Forces, work: Work, t: float, iterations: int, exactly: bool
) -> float:
    count, sigma = _settled((0.0, 0.0), system, forces, work, t, iterations, exactly)
    forces.bearings.passes[1] = count
    return sigma


def _in_space(
    system: System, forces: Forces, work: Work, t: float, iterations: int, exactly: bool
) -> float:
    count, sigma = _settled((0.0, 0.0, 0.0), system, forces, work, t, iterations, exactly)
    forces.bearings.passes[1] = count
    return sigma


@cache
def settle(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Bearings` holds."""
    structs = [each._numba_type() for each in (System, Forces, Work)]
    signature = types.float64(*structs, types.float64, types.int64, types.int64)
    return cfunc(signature, cache=True, error_model='numpy')(
        _in_plane if dimension == 2 else _in_space
    )

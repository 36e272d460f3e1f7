"""Reactions of loaded joints, on the cut mechanism, in which each body has blocks of its own."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.applied_forces import add_friction, applied_forces
from alf_ros.kernel.constraints import add_transposed, jacobian
from alf_ros.kernel.data import Problem
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import block, dot, packed, put
from alf_ros.kernel.numba_ext.jit import ONE, inner
from alf_ros.kernel.numba_ext.vectors import largest, zero


@inner
def place_cut(problem: Problem, t: float) -> None:
    """Position, velocity, Φ_q and load-independent Q of the cut mechanism, from the assembled
    one."""
    unit, work = problem.unit, problem.work
    cut = problem.forces.bearings
    for b in range(cut.source.size):
        put(cut.q, b, block(unit, work.q, cut.source[b]))
        put(cut.qd, b, block(unit, work.qd, cut.source[b]))
    jacobian(unit, cut.rows, cut.q, cut.g, cut.g2)
    applied_forces(cut.effects, t, cut.q, cut.qd, work.near, cut.Q)


@inner
def reactions(problem: Problem, t: float, qdd: Floats, loads: Floats, whole: bool) -> float:
    """R of each loaded joint (N) from q̈ and the λ in `work`, under these loads; `whole`: with the
    forces that do not depend on loads.

    Returns the largest force on a block (N), whose rounding R has: of M q̈, and if `whole` of Q.
    """
    unit, work = problem.unit, problem.work
    cut = problem.forces.bearings
    for b in range(cut.source.size):
        put(cut.qdd, b, block(unit, qdd, cut.source[b]))
    for r in range(cut.source_row.size):
        cut.y[r] = work.y[cut.source_row[r]]
    blocks = cut.needed.size
    zero(cut.needed)
    add_mass_times(unit, cut.mass, 1.0, cut.qdd, cut.needed)
    most = largest(cut.needed, blocks)
    if whole:
        most = max(most, largest(cut.Q, blocks))
        for i in range(blocks):
            cut.needed[i] -= cut.Q[i]
    for i in range(blocks):
        cut.needed[i] = -cut.needed[i]
    add_friction(cut.effects, t, cut.q, cut.qd, work.near, loads, cut.needed)
    for i in range(blocks):
        cut.needed[i] = -cut.needed[i]
    add_transposed(unit, cut.rows, cut.g, cut.g2, cut.y, cut.needed)
    for n in range(cut.answer.size):
        R = packed(unit, 0.0, 0.0, 0.0)
        for m in range(cut.first[n], cut.first[n + ONE]):
            R = R + cut.sign[m] * block(unit, cut.needed, cut.block[m])
        for m in range(cut.first_entry[n], cut.first_entry[n + ONE]):
            R = R - work.y[cut.entry_row[m]] * block(unit, cut.g2, cut.entry[m])
        put(cut.reaction, n, R)
        cut.answer[n] = np.sqrt(dot(R, R))
    return most

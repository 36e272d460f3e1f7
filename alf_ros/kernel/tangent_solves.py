"""Derivatives of a position, of velocities and of accelerations by a parameter θ: the solves of a
stage, with other right-hand sides.

With M constant in q and Φ quadratic, where δ is the derivative by θ and δ' the part of it that
does not come from q and q̇,

    Φ_q δq = -δ'Φ                                    the rest of δq: unchanged, along M
    Φ_q δq̇ = -(δΦ_q) q̇                              the rest of δq̇: likewise
    M δq̈ + Φ_qᵀ δλ = δQ - δM q̈ - (δΦ_q)ᵀ λ,   Φ_q δq̈ = -(δΦ_q) q̈ - δΦ̇_q q̇ - Φ̇_q δq̇

so that each is a solve with the factor of the stage (26), (33).
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.augmented_solve import augmented, solved
from alf_ros.kernel.constraints import add_transposed, jacobian_rate, times_jacobian
from alf_ros.kernel.data import Problem, Rows, Tangents, Until
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.block import add, block, dot, put, subtract, times
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import zero

ONE_ROUND = Until(np.int64(1), 0.0, 1.0)


@inner
def project_position(tangents: Tangents, k: np.uint64, exactly: bool) -> int:
    """Bring δq of parameter k, in `dq`, onto Φ_q δq = -δ'Φ along M, at q in `work`.

    `exactly` and the result are as for `velocities`; rows of velocities stay as they are.
    """
    problem = tangents.problem
    unit, system, work = problem.unit, problem.system, problem.work
    rows = system.rows
    m1, positions = rows.i.size, rows.i.size + rows.c.size
    times_jacobian(unit, rows, work.g, work.g2, tangents.dq, work.r2)
    for r in range(positions):
        work.r2[r], work.y[r] = -work.r2[r], 0.0
    for r in range(positions, work.r2.size):
        work.r2[r], work.y[r] = 0.0, 0.0
    if tangents.rows_change[k] != 0:
        for r in range(m1):
            work.r2[r] += 0.5 * tangents.length2[k * m1 + r]
        for r in each(0, rows.c.size):
            s = tangents.c[k * rows.c.size + r]
            for e in each(rows.first[r], rows.first[r + ONE]):
                g = block(unit, tangents.b, k * rows.block.size + e)
                g = g + 0.5 * _changed_terms(unit, rows, tangents, k, e, work.q)
                s += dot(block(unit, work.q, rows.block[e]), g)
            work.r2[m1 + r] -= s
    return _solve_along_mass(tangents, tangents.dq, exactly)


@inner
def project_velocity(tangents: Tangents, k: np.uint64, exactly: bool) -> int:
    """Bring δq̇ of parameter k, in `dqd`, onto Φ_q δq̇ = -(δΦ_q) q̇ along M, for δq in `dq`."""
    problem = tangents.problem
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    _change_rows(tangents, k)
    times_jacobian(unit, rows, tangents.g, tangents.g2, work.qd, work.r2)
    times_jacobian(unit, rows, work.g, work.g2, tangents.dqd, work.y)
    for r in range(work.r2.size):
        work.r2[r], work.y[r] = -work.r2[r] - work.y[r], 0.0
    return _solve_along_mass(tangents, tangents.dqd, exactly)


@inner
def _solve_along_mass(tangents: Tangents, x: Floats, exactly: bool) -> int:
    """Move x (all blocks D,) along M by what r2 in `work` says; the iterations."""
    problem = tangents.problem
    zero(tangents.f)
    add_mass_times(problem.unit, problem.system.mass, 1.0, x, tangents.f)
    count, _sigma = solved(problem, tangents.f, x, exactly, False)
    return count


@inner
def accelerate_tangent(
    tangents: Tangents, k: np.uint64, t: float, exactly: bool, forced: bool
) -> int:
    """δq̈ of parameter k, into `x`, for δq and δq̇ in `dq` and `dqd`, at q, q̇, q̈ in `work` and λ in
    `lam`; the iterations. `forced`: δQ is not in `f` already."""
    problem = tangents.problem
    unit, system, work = problem.unit, problem.system, problem.work
    rows, f = system.rows, tangents.f
    if forced:
        zero(f)
        add_force_change(tangents, k, t)
    if tangents.mass_changes[k] != 0:
        _subtract_mass_change(problem, tangents, k)
    _change_rows(tangents, k)
    add_transposed(unit, rows, tangents.g, tangents.g2, tangents.lam, f)
    for r in each(0, rows.i.size):
        i, j = rows.i[r], rows.j[r]
        s = dot(block(unit, tangents.g, r), block(unit, work.qdd, i) - block(unit, work.qdd, j))
        v = block(unit, work.qd, i) - block(unit, work.qd, j)
        dv = block(unit, tangents.dqd, i) - block(unit, tangents.dqd, j)
        work.r2[r] = -s - 2.0 * dot(v, dv)
    if rows.movable.size > 0:
        jacobian_rate(unit, rows, work.qd, work.g2d)
        jacobian_rate(unit, rows, tangents.dqd, tangents.g2v)
        if tangents.rows_change[k] != 0:
            for e in each(0, rows.block.size):
                add(tangents.g2v, e, _changed_terms(unit, rows, tangents, k, e, work.qd))
    for r in each(0, rows.movable.size):
        s = 0.0
        for e in each(rows.first[r], rows.first[r + ONE]):
            b = rows.block[e]
            s += dot(block(unit, tangents.g2, e), block(unit, work.qdd, b))
            s += dot(block(unit, tangents.g2v, e), block(unit, work.qd, b))
            s += dot(block(unit, work.g2d, e), block(unit, tangents.dqd, b))
        work.r2[rows.i.size + r] = -s
    zero(work.y)
    zero(tangents.x)
    count, _sigma = solved(problem, f, tangents.x, exactly, False)  # (26)
    if not exactly:
        # the factor is of a position beside this one, and rows may be off by a little of what f
        # does to the masses alone: the projection corrects a motion, but nothing a derivative
        augmented(unit, system, work, f, tangents.x, ONE_ROUND, False)
    return count


@inner
def add_force_change(tangents: Tangents, k: np.uint64, t: float) -> None:
    """f += δQ of parameter k, for δq and δq̇ in `dq` and `dqd`, at q, q̇ in `work`."""
    work, effects = tangents.problem.work, tangents.problem.forces.effects
    zero(tangents.Q)
    for e in range(effects.force.size):
        call(
            tangents.force[e],
            t,
            work.q,
            tangents.dq,
            work.qd,
            tangents.dqd,
            work.near,
            effects.slots,
            effects.slots_at[e],
            effects.params,
            effects.params_at[e],
            tangents.params,
            k * effects.params.size + effects.params_at[e],
            tangents.Q,
            tangents.f,
        )


@inner
def _subtract_mass_change(problem: Problem, tangents: Tangents, k: np.uint64) -> None:
    """f -= δM q̈."""
    unit, mass, qdd, f = problem.unit, problem.system.mass, problem.work.qdd, tangents.f
    D = np.uint64(len(unit))
    for i in each(0, mass.diagonal.size):
        subtract(f, i, tangents.mass_diagonal[k * mass.diagonal.size + i] * block(unit, qdd, i))
    for n in each(0, mass.i.size):
        i, j, m = mass.i[n], mass.j[n], tangents.mass_k[k * mass.i.size + n]
        subtract(f, i, m * block(unit, qdd, j))
        subtract(f, j, m * block(unit, qdd, i))
    for n in each(0, mass.skew.size):
        i, j = mass.i[mass.skew[n]] * D, mass.j[mass.skew[n]] * D
        w = tangents.mass_w[k * mass.skew.size + n]
        f[i] += w * qdd[j + ONE]
        f[i + ONE] -= w * qdd[j]
        f[j] -= w * qdd[i + ONE]
        f[j + ONE] += w * qdd[i]


@inner
def _change_rows(tangents: Tangents, k: np.uint64) -> None:
    """δΦ_q of parameter k into `g` and `g2`, for δq in `dq`."""
    problem = tangents.problem
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    for r in each(0, rows.i.size):
        d = block(unit, tangents.dq, rows.i[r]) - block(unit, tangents.dq, rows.j[r])
        put(tangents.g, r, d)
    if rows.movable.size == 0:
        return
    jacobian_rate(unit, rows, tangents.dq, tangents.g2)
    if tangents.rows_change[k] != 0:
        for e in each(0, rows.block.size):
            b = block(unit, tangents.b, k * rows.block.size + e)
            add(tangents.g2, e, b + _changed_terms(unit, rows, tangents, k, e, work.q))


@inner
def _changed_terms(
    unit: Unit, rows: Rows, tangents: Tangents, k: np.uint64, e: np.uint64, v: Floats
) -> Floats:
    """δ'T v, of entry e."""
    g = 0.0 * block(unit, v, rows.block[e])
    for s in each(rows.first_term[e], rows.first_term[e + ONE]):
        at = k * rows.term_block.size + s
        g = g + times(unit, tangents.term, at, block(unit, v, rows.term_block[s]))
    return g

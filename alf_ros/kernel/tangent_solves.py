"""Derivatives of a position, of velocities and of accelerations by parameters θ: the solves of a
stage, with other right-hand sides, for a group of parameters at once.

With M constant in q and Φ quadratic, where δ is the derivative by θ and δ' the part of it that
does not come from q and q̇,

    Φ_q δq = -δ'Φ                                    the rest of δq: unchanged, along M
    Φ_q δq̇ = -(δΦ_q) q̇                              the rest of δq̇: likewise
    M δq̈ + Φ_qᵀ δλ = δQ - δM q̈ - (δΦ_q)ᵀ λ,   Φ_q δq̈ = -(δΦ_q) q̈ - δΦ̇_q q̇ - Φ̇_q δq̇ - Φ_q,s δs̈

so that each is a solve with the factor of the stage (26), (33). What belongs to the stage alone is
read once for all groups, and entries of Φ_q that are constant are passed over.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import jacobian_rate
from alf_ros.kernel.data import FollowedStage, Problem, Rows, Tangents
from alf_ros.kernel.numba_ext.block import add, block, dot, put, subtract, times
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, TWO, expanded, inner
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import Lanes
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.tangent_lane_solve import ALONG_MASS, UNDER_FORCES, solved_together


@inner
def group_of(tangents: Tangents, v: Lanes, k: np.uint64) -> Lanes:
    """Of v (groups, all blocks D) the part of group k."""
    whole = tangents.Q.size
    return section(v, k * whole, whole)


@inner
def project_position(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64, slow_modes: np.uint64
) -> bool:
    """Bring δq of group k onto Φ_q δq = -δ'Φ along M, at q of the stage.

    `slow_modes` and the result are as for `solved_together`; rows of velocities stay as they are.
    """
    unit, rows, q = problem.unit, problem.system.rows, at.work.q
    dq = group_of(tangents, tangents.q, k)
    m1 = rows.i.size
    for r in each(0, m1):
        d = block(unit, dq, rows.i[r]) - block(unit, dq, rows.j[r])
        at.r2[r] = -dot(block(unit, at.g, r), d)
    for r in each(0, rows.c.size):
        s = 0.0
        for e in each(rows.first[r], rows.first[r + ONE]):
            s -= dot(block(unit, at.g2, e), block(unit, dq, rows.block[e]))
        at.r2[m1 + r] = s
    for r in range(m1 + rows.c.size, at.r2.size):
        at.r2[r] = 0.0
    if tangents.rows_change[k] != 0:
        for r in each(0, m1):
            at.r2[r] += 0.5 * tangents.length2[k * m1 + r]
        for r in each(0, rows.c.size):
            s = at.r2[m1 + r] - tangents.c[k * rows.c.size + r]
            for e in each(rows.first[r], rows.first[r + ONE]):
                g = block(unit, tangents.b, k * rows.block.size + e)
                g = g + 0.5 * _changed_terms(unit, rows, tangents, k, e, q)
                s -= dot(block(unit, q, rows.block[e]), g)
            at.r2[m1 + r] = s
    return _solve_along_mass(tangents, problem, at, dq, slow_modes)


@inner
def project_velocity(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64, slow_modes: np.uint64
) -> bool:
    """Bring δq̇ of group k onto Φ_q δq̇ = -(δΦ_q) q̇ along M, at q and q̇ of the stage."""
    _open_velocities(tangents, problem, at, k)
    dqd = group_of(tangents, tangents.qd, k)
    return _solve_along_mass(tangents, problem, at, dqd, slow_modes)


@inner
def velocity_of_momentum(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64, slow_modes: np.uint64
) -> bool:
    """δq̇ of group k from δp, which stands in its place, at q, q̇ and σ of the stage (33)."""
    work, f = at.work, tangents.f
    dqd = group_of(tangents, tangents.qd, k)
    copy(dqd, f)
    for a in each(0, work.p.size):
        dqd[a] = 0.0
    if tangents.mass_changes[k] != 0:
        add_mass_change(problem, tangents, k, -1.0, work.qd)
    _subtract_turned_rows(tangents, problem, at, k)
    _open_velocities(tangents, problem, at, k)
    zero(at.y)
    copy(f, at.delta)
    _add_rows(problem, at)
    unknown = 0.0 * f[0] + np.inf
    return solved_together(tangents, problem, at, dqd, slow_modes, UNDER_FORCES, unknown)


@inner
def _subtract_turned_rows(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64
) -> None:
    """f -= (δΦ_q)ᵀ σ of group k."""
    unit, rows, work, f = problem.unit, problem.system.rows, at.work, tangents.f
    dq = group_of(tangents, tangents.q, k)
    for r in each(0, rows.i.size):
        d = work.sigma[r] * (block(unit, dq, rows.i[r]) - block(unit, dq, rows.j[r]))
        subtract(f, rows.i[r], d)
        if r < rows.both:
            add(f, rows.j[r], d)
    for r in each(0, rows.movable.size):
        sigma = work.sigma[rows.i.size + r]
        for e in each(rows.first[r], rows.movable[r]):
            for n in each(rows.first_term[e], rows.first_term[e + ONE]):
                d = times(unit, rows.term, n, block(unit, dq, rows.term_block[n]))
                subtract(f, rows.block[e], sigma * d)
            if tangents.rows_change[k] != 0:
                d = _changed_entry(unit, rows, tangents, k, e, work.q)
                subtract(f, rows.block[e], sigma * d)


@inner
def _open_velocities(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64
) -> None:
    """-(δΦ_q) q̇ - Φ_q δq̇ of group k into r2 of the stage."""
    unit, rows, qd = problem.unit, problem.system.rows, at.work.qd
    dq, dqd = group_of(tangents, tangents.q, k), group_of(tangents, tangents.qd, k)
    for r in each(0, rows.i.size):
        i, j = rows.i[r], rows.j[r]
        s = dot(block(unit, at.g, r), block(unit, dqd, i) - block(unit, dqd, j))
        v = block(unit, qd, i) - block(unit, qd, j)
        at.r2[r] = -s - dot(v, block(unit, dq, i) - block(unit, dq, j))
    for r in each(0, rows.movable.size):
        s = 0.0
        for e in each(rows.first[r], rows.first[r + ONE]):
            s -= dot(block(unit, at.g2, e), block(unit, dqd, rows.block[e]))
            for n in each(rows.first_term[e], rows.first_term[e + ONE]):
                s -= dot(block(unit, tangents.term_qd, n), block(unit, dq, rows.term_block[n]))
            if tangents.rows_change[k] != 0:
                g = _changed_entry(unit, rows, tangents, k, e, at.work.q)
                s -= dot(block(unit, qd, rows.block[e]), g)
        at.r2[rows.i.size + r] = s


@inner
def _solve_along_mass(
    tangents: Tangents, problem: Problem, at: FollowedStage, x: Lanes, slow_modes: np.uint64
) -> bool:
    """Move x (all blocks D,) along M by what r2 of the stage says."""
    scale = problem.system.rows.scale
    zero(at.y)
    zero(at.delta)
    _add_rows(problem, at)
    open_by = 0.0 * at.delta[0]
    for r in range(at.r2.size):
        open_by = max(open_by, abs(scale[r] * at.r2[r]))
    return solved_together(tangents, problem, at, x, slow_modes, ALONG_MASS, open_by)


@inner
def begin_rates(tangents: Tangents, problem: Problem, at: FollowedStage) -> None:
    """Φ̇_q and Tᵀ q̇ of a stage, for all groups."""
    rows = problem.system.rows
    if rows.movable.size > 0:
        jacobian_rate(problem.unit, rows, at.work.qd, tangents.g2d)
        _times_terms(problem.unit, rows, tangents.even, at.work.qd, tangents.term_qd)


@inner
def begin_stage(tangents: Tangents, problem: Problem, at: FollowedStage) -> None:
    """Φ̇_q, Tᵀ q̇ and Tᵀ q̈ of a stage, for all groups."""
    begin_rates(tangents, problem, at)
    rows = problem.system.rows
    if rows.movable.size > 0:
        _times_terms(problem.unit, rows, tangents.even, at.work.qdd, tangents.term_qdd)


@inner
def _times_terms(unit: Unit, rows: Rows, even: Floats, v: Floats, out: Floats) -> None:
    """Tᵀ v of each term, for v (all blocks D,) of the block of its entry; `even` as in
    `Tangents`."""
    D = np.uint64(len(unit))
    for e in each(0, rows.block.size):
        for n in each(rows.first_term[e], rows.first_term[e + ONE]):
            if even[n] == even[n]:
                put(out, n, even[n] * block(unit, v, rows.block[e]))
                continue
            b = rows.block[e] * D
            u = v[b] * block(unit, rows.term, n * D) + v[b + ONE] * block(
                unit, rows.term, n * D + ONE
            )
            if D != TWO:
                u = u + v[b + TWO] * block(unit, rows.term, n * D + TWO)
            put(out, n, u)


@inner
def accelerate_tangents(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64, slow_modes: np.uint64
) -> bool:
    """δq̈ of group k, for δq and δq̇, at q, q̇, q̈ of the stage, λ in `lam` and δQ in `f`.

    `slow_modes` and the result are as for `solved_together`.
    """
    unit, rows, work, f = problem.unit, problem.system.rows, at.work, tangents.f
    dq, dqd = group_of(tangents, tangents.q, k), group_of(tangents, tangents.qd, k)
    m1, lam = rows.i.size, tangents.lam
    if tangents.mass_changes[k] != 0:
        add_mass_change(problem, tangents, k, -1.0, work.qdd)
    for r in each(0, m1):
        i, j = rows.i[r], rows.j[r]
        d = block(unit, dq, i) - block(unit, dq, j)
        s = -dot(block(unit, work.qdd, i) - block(unit, work.qdd, j), d)
        v = block(unit, work.qd, i) - block(unit, work.qd, j)
        s -= dot(2.0 * v, block(unit, dqd, i) - block(unit, dqd, j))
        at.r2[r], at.y[r], d = s, 0.0, lam[r] * d
        add(f, i, d)
        if r < rows.both:
            subtract(f, j, d)
    for r in each(0, rows.movable.size):
        s = _driven(tangents, rows, at, k, r)
        for e in each(rows.first[r], rows.first[r + ONE]):
            if rows.first_term[e] != rows.first_term[e + ONE]:
                s -= dot(block(unit, tangents.g2d, e), block(unit, dqd, rows.block[e]))
            for n in each(rows.first_term[e], rows.first_term[e + ONE]):
                d, dv = block(unit, dq, rows.term_block[n]), block(unit, dqd, rows.term_block[n])
                s -= dot(block(unit, tangents.term_qdd, n), d)
                s -= dot(block(unit, tangents.term_qd, n), dv)
                if e < rows.movable[r]:
                    c = tangents.even[n]
                    if c == c:
                        add(f, rows.block[e], (lam[m1 + r] * c) * d)
                    else:
                        add(f, rows.block[e], lam[m1 + r] * times(unit, rows.term, n, d))
        at.r2[m1 + r], at.y[m1 + r] = s, 0.0
    if tangents.rows_change[k] != 0:
        _add_changed_rows(tangents, problem, at, k)
    copy(f, at.delta)
    _add_rows(problem, at)
    dqdd = group_of(tangents, tangents.qdd, k)
    zero(dqdd)
    unknown = 0.0 * f[0] + np.inf
    good = solved_together(tangents, problem, at, dqdd, slow_modes, UNDER_FORCES, unknown)  # (26)
    if tangents.drive.size > 0:
        driven = group_of(tangents, tangents.drive_qdd, k)
        for a in each(work.p.size, work.q.size):
            dqdd[a] = driven[a]
    return good


@inner
def _driven(
    tangents: Tangents, rows: Rows, at: FollowedStage, k: np.uint64, r: np.uint64
) -> Lanes:
    """-Φ_q,s δs̈ of quadratic row r."""
    s = 0.0 * at.delta[0]
    if tangents.drive.size > 0:
        driven = group_of(tangents, tangents.drive_qdd, k)
        for e in each(rows.movable[r], rows.first[r + ONE]):
            s -= dot(block(tangents.unit, at.g2, e), block(tangents.unit, driven, rows.block[e]))
    return s


@expanded
def _add_changed_rows(
    tangents: Tangents, problem: Problem, at: FollowedStage, k: np.uint64
) -> None:
    """Of rows that depend on parameters of group k: -(δ'Φ_q) q̈ - δ'Φ̇_q q̇ to r2 of the stage, and
    -(δ'Φ_q)ᵀ λ to `f`."""
    unit, rows, work = problem.unit, problem.system.rows, at.work
    m1 = rows.i.size
    for r in each(0, rows.movable.size):
        s = at.r2[m1 + r]
        for e in each(rows.first[r], rows.first[r + ONE]):
            b, d = rows.block[e], _changed_entry(unit, rows, tangents, k, e, work.q)
            dv = _changed_terms(unit, rows, tangents, k, e, work.qd)
            s -= dot(block(unit, work.qdd, b), d) + dot(block(unit, work.qd, b), dv)
            if e < rows.movable[r]:
                add(tangents.f, b, tangents.lam[m1 + r] * d)
        at.r2[m1 + r] = s


@inner
def _add_rows(problem: Problem, at: FollowedStage) -> None:
    """δ += Φ_qᵀ α r2 with the Φ_q of the factor."""
    unit, rows, m1 = problem.unit, problem.system.rows, problem.system.rows.i.size
    for r in each(0, m1):
        v = (rows.alpha[r] * at.r2[r]) * block(unit, at.gf, r)
        add(at.delta, rows.i[r], v)
        if r < rows.both:
            subtract(at.delta, rows.j[r], v)
    for r in each(0, rows.movable.size):
        s = rows.alpha[m1 + r] * at.r2[m1 + r]
        for e in each(rows.first[r], rows.movable[r]):
            add(at.delta, rows.block[e], s * block(unit, at.g2f, e))


@inner
def change_forces(tangents: Tangents, at: FollowedStage, k: np.uint64, t: float) -> None:
    """δQ of group k into `f`, for δq and δq̇, at q, q̇ of the stage. The forces of the tangents
    have places for inputs that the run does not hold."""
    work, effects = at.work, tangents.problem.forces.effects
    zero(tangents.f)
    zero(tangents.Q)
    for e in range(effects.force.size):
        call(
            tangents.force[e],
            t,
            work.q,
            group_of(tangents, tangents.q, k),
            work.qd,
            group_of(tangents, tangents.qd, k),
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


@expanded
def add_mass_change(
    problem: Problem, tangents: Tangents, k: np.uint64, s: float, v: Floats
) -> None:
    """f += s δM v."""
    unit, mass, f = problem.unit, problem.system.mass, tangents.f
    D = np.uint64(len(unit))
    for i in each(0, mass.diagonal.size):
        add(f, i, tangents.mass_diagonal[k * mass.diagonal.size + i] * (s * block(unit, v, i)))
    for n in each(0, mass.i.size):
        i, j, m = mass.i[n], mass.j[n], s * tangents.mass_k[k * mass.i.size + n]
        add(f, i, m * block(unit, v, j))
        add(f, j, m * block(unit, v, i))
    for n in each(0, mass.skew.size):
        i, j = mass.i[mass.skew[n]] * D, mass.j[mass.skew[n]] * D
        w = s * tangents.mass_w[k * mass.skew.size + n]
        f[i] -= w * v[j + ONE]
        f[i + ONE] += w * v[j]
        f[j] += w * v[i + ONE]
        f[j + ONE] -= w * v[i]


@inner
def _changed_entry(
    unit: Unit, rows: Rows, tangents: Tangents, k: np.uint64, e: np.uint64, q: Floats
) -> Lanes:
    """δ'b + δ'T q, of entry e."""
    g = block(unit, tangents.b, k * rows.block.size + e)
    return g + _changed_terms(unit, rows, tangents, k, e, q)


@inner
def _changed_terms(
    unit: Unit, rows: Rows, tangents: Tangents, k: np.uint64, e: np.uint64, v: Floats
) -> Lanes:
    """δ'T v, of entry e."""
    g = 0.0 * block(unit, tangents.b, k * rows.block.size + e)
    for s in each(rows.first_term[e], rows.first_term[e + ONE]):
        of = k * rows.term_block.size + s
        g = g + times(unit, tangents.term, of, block(unit, v, rows.term_block[s]))
    return g

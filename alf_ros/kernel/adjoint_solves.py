"""The solves of tangents (`tangent_solves`), transposed.

A solve is symmetric: if (x, y) solves K (x, y) = (f, ρ), with K = [[M, Φ_qᵀ], [Φ_q, 0]], then a
number J that changes by x̄ᵀ δx changes by uᵀ δf + wᵀ δρ, where K (u, w) = (x̄, 0). So each solve of
the tangents is a solve of the adjoint with the same factor. What f and ρ are made of is taken back
term by term: rows are quadratic, so that the derivative of Φ_q by q is constant.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.augmented_solve import solved
from alf_ros.kernel.constraints import add_transposed, jacobian_rate
from alf_ros.kernel.data import Adjoint
from alf_ros.kernel.numba_ext.block import add, block, dot, put, subtract
from alf_ros.kernel.numba_ext.jit import ONE, TWO, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy, zero


@inner
def _solve_back(adjoint: Adjoint, bar: Floats) -> int:
    """u into `u` and w into y of `work`, for x̄ = `bar` (movable D,), at q in `work`; the
    iterations."""
    problem, u = adjoint.tangents.problem, adjoint.u
    work, f = problem.work, adjoint.f
    for a in range(work.p.size):  # fixed blocks are 0
        f[a] = bar[a]
    copy(f, work.delta)
    zero(u)
    zero(work.y)
    zero(work.r2)
    count, _sigma = solved(problem, f, u, True)
    return count


@inner
def project_position_back(adjoint: Adjoint) -> int:
    """∂J/∂δq behind `project_position`, in `q`, into that before it; the iterations."""
    problem = adjoint.tangents.problem
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    m1, positions = rows.i.size, rows.i.size + rows.c.size
    count = _solve_back(adjoint, adjoint.q)
    for r in range(positions, work.y.size):
        work.y[r] = 0.0
    for r in range(work.y.size):
        work.y[r] = -work.y[r]
    add_transposed(unit, rows, work.g, work.g2, work.y, adjoint.q)
    for r in range(m1):
        adjoint.length2[r] -= 0.5 * work.y[r]
    for r in each(0, rows.c.size):
        w = work.y[m1 + r]
        adjoint.c[r] += w
        for e in each(rows.first[r], rows.first[r + ONE]):
            q = w * block(unit, work.q, rows.block[e])
            add(adjoint.b, e, q)
            put(adjoint.g2, e, 0.5 * q)
    _take_changes_back(adjoint, adjoint.g2, work.q, rows.first[rows.c.size])
    return count


@inner
def project_velocity_back(adjoint: Adjoint) -> int:
    """∂J/∂δq̇ behind `project_velocity`, in `qd`, into that before it; adds to ∂J/∂δq in `q`."""
    problem = adjoint.tangents.problem
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    g, g2 = adjoint.g, adjoint.g2
    count = _solve_back(adjoint, adjoint.qd)
    for r in range(work.y.size):
        work.y[r] = -work.y[r]
    add_transposed(unit, rows, work.g, work.g2, work.y, adjoint.qd)
    for r in each(0, rows.i.size):
        d = block(unit, work.qd, rows.i[r]) - block(unit, work.qd, rows.j[r])
        put(g, r, work.y[r] * d)
    for r in each(0, rows.movable.size):
        w = work.y[rows.i.size + r]
        for e in each(rows.first[r], rows.first[r + ONE]):
            put(g2, e, w * block(unit, work.qd, rows.block[e]))
    _take_rows_back(adjoint)
    return count


@inner
def velocity_of_momentum_back(adjoint: Adjoint) -> int:
    """∂J/∂δq̇ behind `velocity_of_momentum`, in `qd`, into ∂J/∂δp; adds to ∂J/∂δq in `q`."""
    problem = adjoint.tangents.problem
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    u, g, g2 = adjoint.u, adjoint.g, adjoint.g2
    count = _solve_back(adjoint, adjoint.qd)
    for r in range(work.y.size):
        work.y[r] = -work.y[r]
    add_transposed(unit, rows, work.g, work.g2, work.y, adjoint.qd)
    for a in range(work.p.size):  # prescribed blocks alone keep what they had
        adjoint.qd[a] = u[a]
    take_mass_back(adjoint, -1.0, u, work.qd)
    for r in each(0, rows.i.size):
        i, j = rows.i[r], rows.j[r]
        d = work.y[r] * (block(unit, work.qd, i) - block(unit, work.qd, j))
        put(g, r, d - work.sigma[r] * (block(unit, u, i) - block(unit, u, j)))
    for r in each(0, rows.movable.size):
        w, sigma = work.y[rows.i.size + r], work.sigma[rows.i.size + r]
        for e in each(rows.first[r], rows.first[r + ONE]):
            at = rows.block[e]
            put(g2, e, w * block(unit, work.qd, at) - sigma * block(unit, u, at))
    _take_rows_back(adjoint)
    return count


@inner
def accelerate_back(adjoint: Adjoint) -> int:
    """∂J/∂δq̈, in `qdd`, into ∂J/∂δQ, in `u`; adds to ∂J/∂δq and ∂J/∂δq̇ in `q` and `qd`, but
    without the part of δQ, and to ∂J/∂δs̈ behind the movable blocks of `qdd`. At q, q̇, q̈ in
    `work` and -λ in `lam`; the iterations."""
    problem, tangents = adjoint.tangents.problem, adjoint.tangents
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    u, g, g2 = adjoint.u, adjoint.g, adjoint.g2
    count = _solve_back(adjoint, adjoint.qdd)
    take_mass_back(adjoint, -1.0, u, work.qdd)
    for r in each(0, rows.i.size):
        i, j, w = rows.i[r], rows.j[r], work.y[r]
        a = block(unit, work.qdd, i) - block(unit, work.qdd, j)
        along = block(unit, u, i) - block(unit, u, j)
        put(g, r, tangents.lam[r] * along - w * a)
        v = (2.0 * w) * (block(unit, work.qd, i) - block(unit, work.qd, j))
        subtract(adjoint.qd, i, v)
        add(adjoint.qd, j, v)
    if rows.movable.size > 0:
        jacobian_rate(unit, rows, work.qd, work.g2d)
    for r in each(0, rows.movable.size):
        w, pull = work.y[rows.i.size + r], tangents.lam[rows.i.size + r]
        for e in each(rows.first[r], rows.first[r + ONE]):
            at = rows.block[e]
            put(g2, e, pull * block(unit, u, at) - w * block(unit, work.qdd, at))
            subtract(adjoint.qd, at, w * block(unit, work.g2d, e))
            put(adjoint.g2v, e, (-w) * block(unit, work.qd, at))
        for e in each(rows.movable[r], rows.first[r + ONE]):
            subtract(adjoint.qdd, rows.block[e], w * block(unit, work.g2, e))
    _take_terms_back(adjoint, adjoint.g2v, work.qd, adjoint.qd)
    _take_rows_back(adjoint)
    return count


@inner
def _take_rows_back(adjoint: Adjoint) -> None:
    """∂J/∂δΦ_q, in `g` and `g2`, into ∂J/∂δq, b̄ and ∂J/∂T."""
    problem = adjoint.tangents.problem
    unit, rows, work = problem.unit, problem.system.rows, problem.work
    for r in each(0, rows.i.size):
        d = block(unit, adjoint.g, r)
        add(adjoint.q, rows.i[r], d)
        subtract(adjoint.q, rows.j[r], d)
    for e in each(0, rows.block.size):
        add(adjoint.b, e, block(unit, adjoint.g2, e))
    _take_terms_back(adjoint, adjoint.g2, work.q, adjoint.q)


@inner
def _take_terms_back(adjoint: Adjoint, g: Floats, v: Floats, bar: Floats) -> None:
    """∂J/∂(T v) of all entries, in g, into ∂J/∂T, and into ∂J/∂v, in `bar`."""
    unit, rows = adjoint.tangents.problem.unit, adjoint.tangents.problem.system.rows
    D, even, term = np.uint64(len(unit)), adjoint.tangents.even, rows.term
    _take_changes_back(adjoint, g, v, rows.block.size)
    for e in each(0, rows.block.size):
        for s in each(rows.first_term[e], rows.first_term[e + ONE]):
            if even[s] == even[s]:
                add(bar, rows.term_block[s], even[s] * block(unit, g, e))
                continue
            u = g[e * D] * block(unit, term, s * D) + g[e * D + ONE] * block(
                unit, term, s * D + ONE
            )
            if D != TWO:
                u = u + g[e * D + TWO] * block(unit, term, s * D + TWO)
            add(bar, rows.term_block[s], u)


@inner
def _take_changes_back(adjoint: Adjoint, g: Floats, v: Floats, entries: np.uint64) -> None:
    """∂J/∂(T v) of the first entries, in g, into ∂J/∂T, if that is wanted."""
    rows, D = adjoint.tangents.problem.system.rows, np.uint64(len(adjoint.tangents.problem.unit))
    if adjoint.terms_count[0] == 0:
        return
    for e in each(0, entries):
        for s in each(rows.first_term[e], rows.first_term[e + ONE]):
            at = rows.term_block[s] * D
            for a in range(D):
                for c in range(D):
                    adjoint.term[(s * D + a) * D + c] += g[e * D + a] * v[at + c]


@inner
def take_mass_back(adjoint: Adjoint, s: float, u: Floats, v: Floats) -> None:
    """∂J/∂ a vector s δM v, in u (movable D,), into ∂J/∂δM."""
    problem = adjoint.tangents.problem
    unit, mass = problem.unit, problem.system.mass
    D = np.uint64(len(unit))
    for i in each(0, mass.diagonal.size):
        adjoint.mass_diagonal[i] += s * dot(block(unit, u, i), block(unit, v, i))
    for n in each(0, mass.i.size):
        i, j = mass.i[n], mass.j[n]
        adjoint.mass_k[n] += s * dot(block(unit, u, i), block(unit, v, j))
        adjoint.mass_k[n] += s * dot(block(unit, u, j), block(unit, v, i))
    for n in each(0, mass.skew.size):
        i, j = mass.i[mass.skew[n]] * D, mass.j[mass.skew[n]] * D
        across = u[i] * v[j + ONE] - u[i + ONE] * v[j]
        adjoint.mass_w[n] -= s * (across - u[j] * v[i + ONE] + u[j + ONE] * v[i])

"""Inverse dynamics: the efforts of actuators for a given motion of a mechanism with loops.

A motion q(t) that fulfils the rows needs the force f = M q̈ - Q besides the reactions. Actuators
of efforts u give B u. With Z, the free directions orthonormal in the metric of M, the motion is
the one of the forces if

    Zᵀ B u = Zᵀ f.

P f = Z Zᵀ f is the solution x of M x + Φ_qᵀ y = f, Φ_q x = 0: a solve with the factor of a stage
(26). So the normal equations Bᵀ P B u = Bᵀ P f need no null space, and redundant rows need no
treatment. What u leaves of f is judged in the same metric: P (f - B u) are the accelerations that
the motion misses (Gauss's principle of least constraint).

One round of a solve gives P B and P f up to 1 / penalty. That is enough for the factor of the
normal equations and for a first u, because their residual is computed with a complete solve. It
is so again until the error that is left, the last change times the ratio of the changes, is
rounding: where actuators are about to lose a direction, Bᵀ P B is hardly larger than its error.
"""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel.applied_forces import add_friction, add_one, applied_forces
from alf_ros.kernel.augmented_solve import solved_anew
from alf_ros.kernel.data.actuation import Actuation
from alf_ros.kernel.inverse_trace import mass_trace
from alf_ros.kernel.joint_coordinates import counted_angles, joint_coordinates
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import compiled, inner
from alf_ros.kernel.numba_ext.vectors import copy, zero
from alf_ros.kernel.triangular_solve import solve

_LEAST_PIVOT = 1e-4  # part of a diagonal number that its pivot keeps, at least
_HELD = 1e-4  # part of a pivot that is its error, at most
_SETTLED, _CHANGES = 1e-12, 6  # error left, as a part of u; complete solves for it, at most


@inner
def _place(of: Actuation, k: np.uint64) -> bool:
    """Instant k in the workspace: q, q̇, f = M q̈ - Q, B, and `whole`; returns whether A has a
    factor."""
    problem, work, unit = of.problem, of.problem.work, of.unit
    effects, rub = of.problem.forces.effects, of.problem.forces.bearings.loads
    size, angles, t = work.q.size, of.angles.size, of.t[k]
    for i in range(size):
        work.q[i], work.qd[i] = of.q[k * size + i], of.qd[k * size + i]
    for n in range(angles):
        of.turned[n] = of.turns[k * angles + n]
    _read(of, work.qd)
    if not linearise(unit, problem.system, work, work.q):
        return False
    applied_forces(effects, t, work.q, work.qd, work.near, of.x)
    if rub.size > 0:
        for n in range(rub.size):
            rub[n] = of.loads[k * rub.size + n]
        add_friction(effects, t, work.q, work.qd, work.near, rub, of.x)
    zero(of.f)
    for i in range(size):
        work.qdd[i] = of.qdd[k * size + i]
    add_mass_times(unit, problem.system.mass, 1.0, work.qdd, of.f)
    inertia, force = 0.0, 0.0
    for i in range(work.p.size):
        inertia += of.f[i] * work.qdd[i]
        force += of.x[i] ** 2
        of.f[i] -= of.x[i]
    of.whole[k] = np.sqrt(max(0.0, inertia)) + np.sqrt(force / problem.system.mean)
    for e in range(of.actuators.force.size):
        zero(of.x)
        add_one(of.actuators, e, t, work.q, work.qd, work.near, of.x)
        for i in range(size):
            of.B[e * size + i] = of.x[i]
    return True


@inner
def _read(of: Actuation, qd: Floats) -> None:
    """Joint coordinates at the q in the workspace, and in `speeds` their rates of q̇."""
    work, unit = of.problem.work, of.unit
    angles, spins = of.angles, of.spins
    counted_angles(unit, of.problem.system.angles, work.q, qd, of.turned, angles, spins, work.near)
    joint_coordinates(unit, of.joints, work.q, qd, angles, spins, of.values, of.speeds)


@inner
def _project(of: Actuation) -> None:
    """x = P f."""
    work = of.problem.work
    zero(of.x)
    zero(work.r2)
    zero(work.y)
    solved_anew(of.problem, of.f, of.x, True)


@inner
def _project_twice(of: Actuation) -> None:
    """x = P M P f = P f; overwrites f. A solve leaves a part of f across the rows, the second one
    a part of M P f, which is far less where actuators are about to lose a direction."""
    _project(of)
    zero(of.f)
    add_mass_times(of.unit, of.problem.system.mass, 1.0, of.x, of.f)
    _project(of)


@inner
def _project_nearly(of: Actuation) -> None:
    """x = A⁻¹ f, P f up to 1 / penalty."""
    work, n = of.problem.work, of.problem.work.p.size
    for i in range(of.x.size):
        of.x[i] = of.f[i] if i < n else 0.0
    solve(of.unit, of.problem.system.pattern, work.diagonal, work.off, of.x)


@inner
def _rank(of: Actuation) -> float:
    """The rank of Φ_q, not rounded."""
    work, pattern = of.problem.work, of.problem.system.pattern
    diagonal, off, column = work.diagonal, work.off, work.column
    return work.p.size - mass_trace(of.unit, pattern, diagonal, off, column, of.Z, of.Zo)


@inner
def _along(of: Actuation, e: np.uint64) -> float:
    """Bᵀ x of actuator e."""
    size, n, total = of.x.size, of.problem.work.p.size, 0.0
    for i in range(n):
        total += of.B[e * size + i] * of.x[i]
    return total


@inner
def _alone(of: Actuation, e: np.uint64) -> float:
    """Bᵀ B of actuator e over the mean mass: about Bᵀ P B without rows."""
    size, n, total = of.x.size, of.problem.work.p.size, 0.0
    for i in range(n):
        total += of.B[e * size + i] ** 2
    return total / of.problem.system.mean


@inner
def _size(of: Actuation) -> float:
    """(xᵀ M x)^½ of x = P f: the size of f along the free directions."""
    work, total = of.problem.work, 0.0
    zero(work.delta)
    add_mass_times(of.unit, of.problem.system.mass, 1.0, of.x, work.delta)
    for i in range(work.p.size):
        total += of.x[i] * work.delta[i]
    return np.sqrt(max(0.0, total))


@inner
def _factorise(of: Actuation) -> bool:
    """G = Bᵀ A⁻¹ B as L Lᵀ; returns whether its pivots are large enough.

    Of a mode of σ a part 1 / (1 + s²) is left in B x, x = A⁻¹ B, and the square of this part in
    xᵀ M x. Their difference is tiny if an actuator moves the mechanism, and the whole of G if rows
    hold its direction. These errors of the pivots add up on the way.
    """
    work, pattern = of.problem.work, of.problem.system.pattern
    a, size, n = of.u.size, of.x.size, work.p.size
    for c in range(a):
        for i in range(size):
            of.x[i] = of.B[c * size + i] if i < n else 0.0
        solve(of.unit, pattern, work.diagonal, work.off, of.x)
        for i in range(n):
            of.X[c * size + i] = of.x[i]
        for e in range(c, a):
            of.G[e * a + c] = _along(of, e)
        of.c[c] = of.G[c * a + c] - _size(of) ** 2
    for c in range(a):
        own, held = of.G[c * a + c], of.c[c]
        for k in range(c):
            held += (of.G[c * a + k] / of.G[k * a + k]) ** 2 * of.c[k]
        of.c[c] = held
        for e in range(c, a):
            s = of.G[e * a + c]
            for k in range(c):
                s -= of.G[e * a + k] * of.G[c * a + k]
            if e == c:
                if not s > max(_LEAST_PIVOT * own, held / _HELD):
                    return False
                of.G[c * a + c] = np.sqrt(s)
            else:
                of.G[e * a + c] = s / of.G[c * a + c]
    return True


@inner
def _change(of: Actuation) -> float:
    """Change u by c = G⁻¹ Bᵀ x, and f and x with it; returns (cᵀ G c)^½."""
    a, size, n = of.u.size, of.x.size, of.problem.work.p.size
    square = 0.0
    for e in range(a):
        s = _along(of, e)
        for k in range(e):
            s -= of.G[e * a + k] * of.c[k]
        of.c[e] = s / of.G[e * a + e]
        square += of.c[e] ** 2
    for k in range(a):
        e = a - 1 - k
        s = of.c[e]
        for later in range(e + 1, a):
            s -= of.G[later * a + e] * of.c[later]
        of.c[e] = s / of.G[e * a + e]
    for e in range(a):
        of.u[e] += of.c[e]
        for i in range(n):
            of.f[i] -= of.c[e] * of.B[e * size + i]
            of.x[i] -= of.c[e] * of.X[e * size + i]
    return np.sqrt(square)


@inner
def _report(of: Actuation, k: np.uint64) -> None:
    """Store the efforts of instant k, and the rest of f and x that they leave."""
    of.left[k] = _size(of)
    for e in range(of.u.size):
        of.efforts[k * of.u.size + e] = of.u[e]
    copy(of.x, of.problem.work.qdd)
    _read(of, of.problem.work.qdd)
    for j in range(of.speeds.size):
        of.missing[k * of.speeds.size + j] = of.speeds[j]


@compiled
def needed_efforts(of: Actuation) -> None:
    """`efforts`, `left`, `whole`, `missing` and `rank` of each instant, with actuators that are
    well apart; efforts are NaN where they are not."""
    a, n = of.u.size, of.problem.work.p.size
    for k in range(of.t.size):
        of.rank[k], of.left[k] = np.nan, np.nan
        for e in range(a):
            of.efforts[k * a + e], of.u[e] = np.nan, 0.0
        if not _place(of, k):
            continue
        of.rank[k] = _rank(of)
        if not _factorise(of):
            continue
        _project_nearly(of)
        first = before = _change(of)
        for _ in range(_CHANGES):
            _project(of)
            change = _change(of)
            if change * change <= _SETTLED * first * before:
                break
            before = change
        for e in range(a):
            own = 0.0
            for i in range(n):
                own += of.B[e * of.x.size + i] * of.X[e * of.x.size + i]
            of.whole[k] += abs(of.u[e]) * np.sqrt(max(0.0, own))
        _report(of, k)


@compiled
def effort_equations(of: Actuation) -> None:
    """`gram` and `pull` of each instant, by complete solves."""
    a, size = of.u.size, of.x.size
    for k in range(of.t.size):
        if not _place(of, k):
            continue
        _project_twice(of)
        for e in range(a):
            of.pull[k * a + e], of.alone[k * a + e] = _along(of, e), _alone(of, e)
        for c in range(a):
            for i in range(size):
                of.f[i] = of.B[c * size + i]
            _project_twice(of)
            for e in range(a):
                of.gram[(k * a + e) * a + c] = _along(of, e)


@compiled
def effort_residuals(of: Actuation) -> None:
    """With the `efforts` and the `gram` of each instant: `pull` of what they leave, `left`,
    `whole` and `missing`."""
    a, size = of.u.size, of.x.size
    for k in range(of.t.size):
        if not _place(of, k):
            continue
        for e in range(a):
            of.u[e] = of.efforts[k * a + e]
            for i in range(size):
                of.f[i] -= of.u[e] * of.B[e * size + i]
            own = of.gram[(k * a + e) * a + e]
            of.whole[k] += abs(of.u[e]) * np.sqrt(max(0.0, own))
        _project_twice(of)
        for e in range(a):
            of.pull[k * a + e] = _along(of, e)
        _report(of, k)

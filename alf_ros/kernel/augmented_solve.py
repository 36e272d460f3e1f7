"""The augmented solve (26), (33): velocities from momenta, accelerations from forces."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import applied_forces
from alf_ros.kernel.augmented_residuals import (
    begin_accelerations,
    begin_velocities,
    residuals,
    update_rows,
)
from alf_ros.kernel.constraints import add_transposed, times_jacobian
from alf_ros.kernel.data import EPS, NOTHING, SOLVED, Bearings, Forces, System, Work
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.numba_ext.calls import call_for_number
from alf_ros.kernel.numba_ext.jit import compiled, expanded, inner
from alf_ros.kernel.numba_ext.vectors import largest, zero
from alf_ros.kernel.prescribed import bias
from alf_ros.kernel.triangular_solve import solve, step_by

_MODES = 40  # conjugate gradients, at most
_ROUNDS = 2  # after them, to take away the rounding they bring
_NOISE = 8.0 * EPS  # part of x by which rows are off by rounding
_ROUNDING = 1e-12  # of an eigenvalue


@compiled
def augmented(
    unit: Unit,
    system: System,
    work: Work,
    f: Floats,
    x: Floats,
    iterations: int,
    tolerance: float,
    patience: float,
    begun: bool = False,
) -> tuple[int, float]:
    """Iterate to M x + Φ_qᵀ y = f, Φ_q x = -c with the one factor.

    y and r2 stand in `work`: on entry r2 = -c - Φ_q x, and y is a first guess; in `delta` the
    right-hand side of the first δ, if it is `begun`. (26), (33) in residual form: A δ = f - M x -
    Φ_qᵀ y + Φ_qᵀ α r2,  x += δ,  y += α (Φ_q δ - r2); so α costs no precision. Where α stands, Φ_q
    is that of the factor, and elsewhere that of the place: they may differ a little, and with the
    factor's in both they would converge to the wrong place, with the place's in both they would
    not converge.

    What is left is r2: the next δ of a mode s would be s / (1 + s²) < 1 of |α^½ r2| in the norm of
    M; like x it counts by its largest. It ends when that, and the rounding of the last δ, would
    not matter beside x, or beside what f would do to the masses alone. A mode takes a part
    1 / (1 + s²) of its r2 along: where the ratio of two rounds says that one is above `patience`,
    it ends too. Returned are how often, and the largest ratio that mattered.
    """
    n = work.p.size
    alone = largest(f, n) / system.mean
    fine = max(tolerance, _NOISE * np.sqrt(system.penalty))
    before, slowest = 0.0, 0.0
    for count in range(1, iterations + 1):
        if count > 1 or not begun:
            residuals(unit, system, work, f, x)
        step, size = step_by(unit, system, work, x)
        size = max(size, alone, NOTHING)
        left = np.sqrt(system.penalty) * update_rows(unit, system.rows, work)
        if left <= fine * size:
            if EPS * system.penalty * step <= tolerance * size:
                return count, slowest
        elif count > 1:
            slowest = max(slowest, min(1.0, left / before))
            if slowest > patience:
                return count, slowest
        before = left
    return iterations, slowest


@inner
def _step(beta: float, delta: Floats, x: Floats, n: np.uint64) -> tuple[float, float]:
    """x += β δ; returns the largest of β δ and of x."""
    step, size = 0.0, 0.0
    for i in range(n):
        x[i] += beta * delta[i]
        step = max(step, abs(delta[i]))
        size = max(size, abs(x[i]))
    return abs(beta) * step, size


@compiled
def finish(
    unit: Unit,
    system: System,
    work: Work,
    x: Floats,
    tolerance: float,
    noise: float,
    faintest: float,
    furthest: float,
) -> float:
    """Go on from `augmented` by conjugate gradients, where Φ_q is that of the factor.

    Its iteration is one of steepest descent for Φ_q A⁻¹ Φ_qᵀ z = r2 with α to precondition. The
    eigenvalues are s² / (1 + s²): nearly all of them 1, and that of a row about to lose its
    direction small. Conjugate gradients take as many steps as there are clusters of them, whatever
    the penalty. Returns the least singular value σ met, s² = penalty σ², and 0 if there were too
    many. It ends where rows are off by `noise` or by the rounding of x; and at a mode that cannot
    be told from rounding, whose σ is below `faintest`, or that asks for a step of more than
    `furthest` times σ.
    """
    rows, delta, r2, y, z, w = system.rows, work.delta, work.r2, work.y, work.z, work.w
    n, m = work.p.size, r2.size
    least, rho = np.inf, 0.0
    for r in range(m):
        z[r] = rows.alpha[r] * r2[r]
        rho += r2[r] * z[r]
    for _ in range(_MODES):
        floor = max(noise, _NOISE * largest(x, n), NOTHING)
        if rho <= system.penalty * system.mean * floor * floor:
            return least
        zero(delta)
        add_transposed(unit, rows, work.gf, work.g2f, z, delta)
        for i in range(n, delta.size):  # fixed blocks do not move
            delta[i] = 0.0
        solve(unit, system.pattern, work.diagonal, work.off, delta)
        times_jacobian(unit, rows, work.gf, work.g2f, delta, w)
        zw, zz = 0.0, 0.0
        for r in range(m):
            zw += z[r] * w[r]
            zz += z[r] * z[r] / rows.alpha[r]
        if not zw > _ROUNDING * zz:
            return least
        sigma = np.sqrt(zw / (system.penalty * max(zz - zw, EPS * zz)))
        beta = rho / zw
        if sigma < faintest or beta * largest(delta, n) > furthest * sigma:
            return least
        least = min(least, sigma)
        step, size = _step(beta, delta, x, n)
        after = 0.0
        for r in range(m):
            y[r] += beta * (rows.alpha[r] * w[r] - z[r])
            r2[r] -= beta * w[r]
            after += rows.alpha[r] * r2[r] * r2[r]
        if step <= tolerance * size:
            return least
        for r in range(m):
            z[r] = rows.alpha[r] * r2[r] + after / rho * z[r]
        rho = after
    return 0.0


@expanded
def velocities(
    unit: Unit, system: System, work: Work, iterations: int, exactly: bool
) -> tuple[int, float]:
    """q̇ from the momenta p' with the factor in `work` (33), and Φ_q at q; q̇ there is a guess.

    `exactly` where Φ_q is that of the factor. Returns the iterations, and about the least singular
    value σ; infinite where it is too large to matter, and not `exactly` 0 where it does matter.
    """
    begin_velocities(unit, system, work)
    return solved(unit, system, work, work.p, work.qd, iterations, exactly, True)


@inner
def solved(
    unit: Unit,
    system: System,
    work: Work,
    f: Floats,
    x: Floats,
    iterations: int,
    exactly: bool,
    begun: bool,
) -> tuple[int, float]:
    """`augmented`, and where that is slow `finish`, if Φ_q is that of the factor."""
    patience = system.patience
    count, slowest = augmented(unit, system, work, f, x, iterations, SOLVED, patience, begun)
    if slowest <= patience:
        return count, np.inf
    if not exactly:
        return count, 0.0
    sigma = np.sqrt(max(0.0, 1.0 / slowest - 1.0) / system.penalty)
    sigma = min(sigma, finish(unit, system, work, x, SOLVED, 0.0, 0.0, np.inf))
    for _ in range(_ROUNDS):
        # it comes with the factor 1 / s²: a step on both residuals takes it away
        augmented(unit, system, work, f, x, 1, 0.0, 1.0, False)
        finish(unit, system, work, x, SOLVED, 0.0, 0.0, np.inf)
    return count + _ROUNDS, sigma


@inner
def apply(unit: Unit, system: System, forces: Forces, work: Work, t: float) -> None:
    """Q at q, q̇ in `work`, but for friction that depends on reactions; of an implicit method with
    (M̂ - M) k."""
    applied_forces(forces.effects, t, work.q, work.qd, work.near, work.Q)
    if system.soft.weight.size > 0:
        add_soft_times(unit, system.soft, 1.0, system.soft.k, work.Q)


@compiled
def begin_balance(bearings: Bearings, loads: Floats) -> None:
    """The next solve for accelerations is where a step begins; `loads` is R (N), as found last."""
    for n in range(loads.size):
        bearings.force[n] = loads[n]
    if loads.size > 0:
        bearings.begins[0] = 1


@compiled
def accelerate(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    exactly: bool,
) -> tuple[int, float]:
    """q̈ and λ (in y) at the stage in `work` from its factor, from a cold start (24)-(27).

    `exactly` and what is returned: as for `velocities`. Where friction depends on reactions, and
    no loads are found that agree with it, -1 iterations.
    """
    apply(unit, system, forces, work, t)
    return accelerate_under(unit, system, forces, work, t, iterations, exactly)


@inner
def accelerate_under(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    t: float,
    iterations: int,
    exactly: bool,
) -> tuple[int, float]:
    """The same under the Q in `work`, as `apply` leaves it."""
    if forces.bearings.settle.size > 0:
        for i in range(work.p.size):  # what is prescribed stands behind
            work.qdd[i] = 0.0
        bias(unit, system, work, work.r2)
        for r in range(work.r2.size):
            work.r2[r], work.y[r] = -work.r2[r], 0.0
        sigma = call_for_number(
            forces.bearings.settle[0], system, forces, work, t, np.int64(iterations), exactly
        )
        return forces.bearings.passes[1], sigma
    return accelerate_freely(unit, system, work, iterations, exactly)


@inner
def accelerate_freely(
    unit: Unit, system: System, work: Work, iterations: int, exactly: bool
) -> tuple[int, float]:
    """The same without friction that depends on reactions."""
    for i in range(work.p.size):
        work.qdd[i] = 0.0
    begin_accelerations(unit, system, work, work.Q)
    return solved(unit, system, work, work.Q, work.qdd, iterations, exactly, True)

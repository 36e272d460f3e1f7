"""The augmented solve (26), (33): velocities from momenta, accelerations from forces."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.applied_forces import applied_forces, sides
from alf_ros.kernel.augmented_residuals import (
    begin_accelerations,
    begin_velocities,
    residuals,
    update_rows,
    widest,
)
from alf_ros.kernel.constraints import add_transposed, times_jacobian
from alf_ros.kernel.data import (
    EPS,
    EVERY_MODE,
    NOTHING,
    SOLVED,
    Bearings,
    ModeLimits,
    Problem,
    System,
    Until,
    Work,
)
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.numba_ext.calls import call_for_number
from alf_ros.kernel.numba_ext.jit import ZERO, compiled, expanded, inner
from alf_ros.kernel.numba_ext.lane_numbers import pick
from alf_ros.kernel.numba_ext.lane_structs import section
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.prescribed import bias
from alf_ros.kernel.stopping import LEFT
from alf_ros.kernel.triangular_solve import solve, step_by

DIRECTIONS = 40  # of conjugate residuals, at most
_REFINEMENTS = 2  # rounds after conjugate residuals, which remove the rounding they bring
NOISE = 8.0 * EPS  # part of x by which rows are off by rounding
ROUNDING = 1e-12  # of an eigenvalue


@compiled
def augmented(
    unit: Unit, system: System, work: Work, f: Floats, x: Floats, until: Until
) -> tuple[int, float]:
    """Iterate to M x + Φ_qᵀ y = f, Φ_q x = -c with the one factor (26), (33).

    y and r2 stand in `work`: on entry r2 = -c - Φ_q x, and y is a first guess. Returns what
    `iterate` does.
    """
    residuals(unit, system, work, f, x)
    return iterate(unit, system, work, f, x, until)


@inner
def iterate(
    unit: Unit, system: System, work: Work, f: Floats, x: Floats, until: Until
) -> tuple[int, float]:
    """`augmented`, where the right-hand side of the first δ stands in `work.delta`.

    In residual form

        A δ = f - M x - Φ_qᵀ y + Φ_qᵀ α r2,   x += δ,   y += α (Φ_q δ - r2),

    so α costs no precision. Φ_q comes from the factor in products with α, and from the position
    elsewhere. The two may differ a little. With the Φ_q of the factor in both, the iteration would
    converge to a wrong position; with the Φ_q of the position in both, it would not converge.

    After a round r2 is the residual: the next δ of a mode of singular value s would be
    s / (1 + s²) < 1 of |α^½ r2| in the norm of M. Like x, r2 is measured by its largest number.
    The iteration ends when r2, and the rounding of the last δ, are below `until.tolerance` of x,
    or of what f would do to the masses alone. A round leaves a part 1 / (1 + s²) of r2 in a mode:
    if the ratio of two rounds exceeds `until.patience`, the iteration ends too. In the second
    round a large ratio is no sign of such a mode yet: an error e of the first δ, by rounding,
    comes back as -e and is gone in the third. It shows where λ is about zero: in free fall. What
    rounding leaves open of rows that depend on others (`turned`) is no sign either.
    Returns the rounds, and the largest ratio of two of them that mattered.
    """
    n, iterations, tolerance = work.p.size, until.iterations, until.tolerance
    alone = largest(f, n) / system.mean
    fine = max(tolerance, NOISE * np.sqrt(system.penalty))
    before, slowest = 0.0, 0.0
    for count in range(1, iterations + 1):
        work.pulse[LEFT] -= 1
        if count > 1:
            residuals(unit, system, work, f, x)
        step, size = step_by(unit, system, work, x)  # A δ = …, x += δ: (26), (33)
        size = max(size, alone, NOTHING)
        left = np.sqrt(system.penalty) * update_rows(unit, system.rows, work)
        if left <= fine * size:
            if system.rounding * step <= tolerance * size:
                return count, slowest
        elif count > 1:
            ratio = min(1.0, left / before)
            if ratio <= until.patience or count != 2 or iterations == 2:
                if ratio > until.patience and left <= fine * size * turned(
                    system, work, system.ordinary
                ):
                    return count, slowest
                slowest = max(slowest, ratio)
            if slowest > until.patience:
                return count, slowest
        before = left
    return iterations, slowest


@inner
def turned(system: System, work: Work, sigma: float) -> float:
    """How far rounding turns the row that it turns most, in parts of ε, and at least 1.

    q is rounded by a part ε of its distance from the origin, which turns a bar of length l by
    ε |q| / l. Rows that depend on others contradict each other by that, and by more: q is closed
    to rounding of Φ, so in the softest direction, of `sigma`, only to 1 / σ of it. No round
    changes it, and it is no slow mode.
    """
    bend = system.rows.bend
    found = max(1.0, largest(work.q, work.q.size) * largest(bend, bend.size))
    return pick(has_dependent(system), found / min(1.0, sigma), found)


@inner
def has_dependent(system: System) -> bool:
    """Whether rows depend on others at ordinary positions."""
    return system.rank < system.rows.alpha.size


@inner
def _step(beta: float, delta: Floats, x: Floats, n: np.uint64) -> tuple[float, float]:
    """x += β δ; returns the largest of β δ and of x."""
    step, size = 0.0, 0.0
    for i in range(n):
        x[i] += beta * delta[i]
        step = max(step, abs(delta[i]))
        size = max(size, abs(x[i]))
    return abs(beta) * step, size


@inner
def along_direction(unit: Unit, system: System, work: Work) -> tuple[float, float]:
    """δ = A⁻¹ Φ_qᵀ z and w = Φ_q δ, with the Φ_q of the factor; returns zᵀ w and zᵀ α⁻¹ z."""
    rows, delta, z, w = system.rows, work.delta, work.z, work.w
    zero(delta)
    add_transposed(unit, rows, work.gf, work.g2f, z, delta)
    for i in range(work.p.size, delta.size):  # fixed blocks do not move
        delta[i] = 0.0
    solve(unit, system.pattern, work.diagonal, work.off, delta)
    times_jacobian(unit, rows, work.gf, work.g2f, delta, w)
    zw, zz = 0.0, 0.0
    for r in range(z.size):
        zw += z[r] * w[r]
        zz += z[r] * z[r] / rows.alpha[r]
    return zw, zz


@compiled
def finish(
    unit: Unit, system: System, work: Work, x: Floats, tolerance: float, limits: ModeLimits
) -> float:
    """Continue from `augmented` by conjugate residuals, with the Φ_q of the factor.

    The iteration of `augmented` is steepest descent for Φ_q A⁻¹ Φ_qᵀ z = r2, preconditioned by α.
    The eigenvalues are s² / (1 + s²): nearly all of them 1, and small for a row about to lose its
    direction. Conjugate residuals take as many steps as there are clusters of eigenvalues,
    whatever the penalty. They end where rows are off by `limits.noise` or by the rounding of x,
    and at a mode that `limits` leaves out. A row of velocities without Φ binds no position.

    r2 also has what rounding leaves of rows that depend on others, which no step removes. Where it
    is most of r2, a step of conjugate gradients may be 1 / ROUNDING too long. Conjugate residuals
    make r2 as small as it can be: a step is as long as the modes ask for that it reduces.
    Returns the least singular value σ met, s² = penalty σ²; 0 if there were too many.
    """
    rows, delta, r2, y, z, w = system.rows, work.delta, work.r2, work.y, work.z, work.w
    n, m = np.uint64(work.p.size), np.uint64(r2.size)
    towards, image, combined = search_of(work.search, n, m)
    least, before = np.inf, np.inf
    for _ in range(DIRECTIONS):
        rho, square = 0.0, 0.0
        for r in range(m):
            z[r] = rows.alpha[r] * r2[r]
            rho += r2[r] * z[r]
        floor = max(limits.noise, NOISE * largest(x, n), NOTHING)
        if rho <= system.penalty * system.mean * floor * floor:
            return least
        zw, zz = along_direction(unit, system, work)
        if not zw > ROUNDING * zz:
            return least
        part = zw / before
        for r in range(m):
            bound = r < limits.unbound or r2[r] != 0.0
            image[r] = w[r] + part * image[r] if bound else 0.0
            combined[r] = z[r] + part * combined[r]
            square += rows.alpha[r] * image[r] * image[r]
        for i in range(n):
            towards[i] = delta[i] + part * towards[i]
        beta, eigenvalue = zw / square, square / zw
        sigma = np.sqrt(eigenvalue / (system.penalty * max(1.0 - eigenvalue, EPS)))
        if sigma < limits.faintest or beta * largest(towards, n) > limits.furthest * sigma:
            return least
        least = min(least, sigma)
        step, size = _step(beta, towards, x, n)
        for r in range(m):
            y[r] += beta * (rows.alpha[r] * image[r] - combined[r])
            r2[r] -= beta * image[r]
        if step <= tolerance * size:
            return least
        before = zw
    return 0.0


@inner
def search_of(search: Floats, n: np.uint64, m: np.uint64) -> tuple[Floats, Floats, Floats]:
    """Of the directions of conjugate residuals the step (n), its image (m) and its combination of
    rows (m), all zero."""
    zero(search)
    return section(search, ZERO, n), section(search, n, m), section(search, n + m, m)


@expanded
def velocities(problem: Problem, exactly: bool) -> tuple[int, float]:
    """q̇ from the momenta p' with the factor in `work` (33), and Φ_q at q; q̇ there is a guess.

    `exactly`: Φ_q and factor belong together, so a slow solve can be finished. Returns the
    iterations, and about the least singular value σ: infinite if no mode is slow, 0 if one is slow
    and the solve must not be finished.
    """
    work = problem.work
    begin_velocities(problem.unit, problem.system, work)
    result = solved(problem, work.p, work.qd, exactly)  # (33)
    copy(work.y, work.sigma)
    return result


@inner
def solved_anew(problem: Problem, f: Floats, x: Floats, exactly: bool) -> tuple[int, float]:
    """`solved`, from the x, y and r2 that stand."""
    residuals(problem.unit, problem.system, problem.work, f, x)
    return solved(problem, f, x, exactly)


@inner
def solved(problem: Problem, f: Floats, x: Floats, exactly: bool) -> tuple[int, float]:
    """`iterate`; where that is slow and `exactly` holds, `finish`. Returns what `velocities`
    does."""
    system, work = problem.system, problem.work
    patience = system.patience
    until = Until(np.int64(problem.method.iterations), SOLVED, patience)
    count, slowest = iterate(problem.unit, system, work, f, x, until)
    if slowest <= patience:
        return count, np.inf
    if not exactly:
        return count, 0.0
    return count + _REFINEMENTS, _finished(problem, f, x, slowest)


@inner
def _finished(problem: Problem, f: Floats, x: Floats, slowest: float) -> float:
    """Finish a slow solve; returns about the least singular value σ."""
    unit, system, work = problem.unit, problem.system, problem.work
    least = finish(unit, system, work, x, SOLVED, EVERY_MODE)
    left = widest(system.rows, work.r2)
    for _ in range(_REFINEMENTS):
        # rounding comes with the factor 1 / s²: a round on both residuals takes it away
        augmented(unit, system, work, f, x, Until(np.int64(1), 0.0, 1.0))
        finish(unit, system, work, x, SOLVED, EVERY_MODE)
    if has_dependent(system) and least > 0.0:
        size = max(largest(x, work.p.size), largest(f, work.p.size) / system.mean)
        if left <= NOISE * size * turned(system, work, min(system.ordinary, least)):
            return least  # what they contradict the others by is rounding
    return min(least, np.sqrt(max(0.0, 1.0 / slowest - 1.0) / system.penalty))


@inner
def note_side(problem: Problem, t: float) -> None:
    """Note in `work.sides` whether a kink is between q, q̇ in `work` and the start of the step."""
    work, effects = problem.work, problem.forces.effects
    if effects.side.size > 0:
        here = sides(effects, t, work.q, work.qd, work.near)
        if np.isnan(work.sides[0]):
            work.sides[0] = here
        if here != work.sides[0]:
            work.sides[1] = 1.0


@inner
def apply(problem: Problem, t: float) -> None:
    """Q at q, q̇ in `work`, but for friction that depends on reactions; of an implicit method with
    (M̂ - M) k. Notes the side, as `note_side` does."""
    system, work, effects = problem.system, problem.work, problem.forces.effects
    applied_forces(effects, t, work.q, work.qd, work.near, work.Q)
    note_side(problem, t)
    if system.soft.weight.size > 0:
        add_soft_times(problem.unit, system.soft, 1.0, system.soft.k, work.Q)


@compiled
def restore_reactions(bearings: Bearings, loads: Floats) -> None:
    """Take `loads`, R (N) as found last, for a first guess: the next solve for accelerations is
    where a step begins."""
    for n in range(loads.size):
        bearings.force[n] = loads[n]
    if loads.size > 0:
        bearings.begins[0] = 1


@compiled
def accelerate(problem: Problem, t: float, exactly: bool) -> tuple[int, float]:
    """q̈ and λ (in y) at the stage in `work` from its factor, from a cold start (24)-(27).

    `exactly` and the result are as for `velocities`. Where friction depends on reactions, and no
    loads are found that agree with it, -1 iterations.
    """
    apply(problem, t)
    return accelerate_under(problem, t, exactly)


@inner
def accelerate_under(problem: Problem, t: float, exactly: bool) -> tuple[int, float]:
    """`accelerate` under the Q in `work`, as `apply` leaves it."""
    bearings = problem.forces.bearings
    if bearings.settle.size > 0:
        work = problem.work
        for i in range(work.p.size):  # prescribed blocks follow
            work.qdd[i] = 0.0
        bias(problem.unit, problem.system, work, work.r2)
        for r in range(work.r2.size):
            work.r2[r], work.y[r] = -work.r2[r], 0.0
        sigma = call_for_number(bearings.settle[0], problem, t, exactly)
        return bearings.passes[1], sigma
    return accelerate_freely(problem, exactly)


@inner
def accelerate_freely(problem: Problem, exactly: bool) -> tuple[int, float]:
    """`accelerate_under` without friction that depends on reactions."""
    work = problem.work
    for i in range(work.p.size):
        work.qdd[i] = 0.0
    begin_accelerations(problem.unit, problem.system, work, work.Q)
    return solved(problem, work.Q, work.qdd, exactly)  # (26)

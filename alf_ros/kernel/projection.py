"""Projection onto Φ = 0 along M: of stages and of the ends of steps, with a factor of A."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.augmented_residuals import widest
from alf_ros.kernel.augmented_solve import finish
from alf_ros.kernel.compensated import violation_twofold
from alf_ros.kernel.constraints import add_transposed, forms, times_jacobian, violation
from alf_ros.kernel.data import EPS, ModeLimits, Rows, System, Work
from alf_ros.kernel.ldl import assemble, linearise, solve_on
from alf_ros.kernel.numba_ext.block import add, block, dot, subtract
from alf_ros.kernel.numba_ext.jit import expanded, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import largest, put_difference, put_sum, zero
from alf_ros.kernel.slip import add_slips
from alf_ros.kernel.status import NOT_CLOSED, NOT_POSITIVE, OK
from alf_ros.kernel.triangular_solve import solve

FAINT = 4.0  # times the gap: σ below which a mode may be an artefact of the gap
CLOSED = 0.6  # rounding units: an error of q turns rows beside a singular position
ROUNDED = 0.3  # rounding units, of a stage
_DISTINCT = 0.1  # part of the distance that is too close to a singular position
FURTHEST = 0.1  # part of the distance to a singular position that a correction may go across
FAR = 100.0  # sizes from the origin: products of places in Φ lose digits that q has


@inner
def opening_without_slips(unit: Unit, rows: Rows, q: Floats, phi: Floats) -> float:
    """Φ(q), 0 of rows of velocities, and how far the widest row is open, m."""
    violation(unit, rows, q, phi)
    return widest(rows, phi)


@inner
def opening(unit: Unit, system: System, work: Work) -> float:
    """Φ at the q in `work`, into r2; returns how far the widest row is open, m."""
    gap = opening_without_slips(unit, system.rows, work.q, work.r2)
    return max(gap, add_slips(unit, system, work, work.q, work.r2))


@inner
def opening_twofold(unit: Unit, system: System, work: Work) -> float:
    """`opening`, with Φ to twice the digits of q; a slip to its own."""
    violation_twofold(unit, system.rows, work.q, work.r2)
    gap = widest(system.rows, work.r2)
    return max(gap, add_slips(unit, system, work, work.q, work.r2))


@inner
def _opening(unit: Unit, system: System, work: Work, twofold: bool) -> float:
    """`opening`, or if `twofold` `opening_twofold`."""
    if not twofold:
        return opening(unit, system, work)
    return opening_twofold(unit, system, work)


@inner
def with_values(rows: Rows) -> float:
    """How many rows have a Φ; rows of velocities follow, of which some have an integral."""
    return float(rows.i.size + rows.c.size)


@inner
def correct(unit: Unit, system: System, work: Work) -> None:
    """q -= A⁻¹ Φ_qᵀ α Φ, Φ in r2, with the Jacobian and the factor of one and the same place.

    Φ_q of another place would put α times the difference on the free directions.
    """
    delta, phi = work.delta, work.r2
    for r in range(phi.size):
        phi[r] *= -system.rows.alpha[r]
    zero(delta)
    add_transposed(unit, system.rows, work.gf, work.g2f, phi, delta)
    solve(unit, system.pattern, work.diagonal, work.off, delta)
    for a in range(work.p.size):
        work.q[a] += delta[a]


@inner
def correct_exactly(unit: Unit, system: System, work: Work, gap: float, furthest: float) -> None:
    """`correct`, also in the direction of a row that is about to lose it.

    Off Φ = 0 by `gap` (m), rows that depend on others look as if they were about that far from it.
    Such modes are left out, and so are modes that ask for more than `furthest` (m) times their σ.
    """
    faintest = FAINT * gap / system.size
    limits = ModeLimits(ROUNDED * EPS * system.size, faintest, furthest, with_values(system.rows))
    _correct_modes(unit, system, work, limits)


@inner
def correct_at_last(unit: Unit, system: System, work: Work) -> None:
    """The last correction, of rounding errors, with Φ to twice the digits, in modes that differ
    from dependent rows."""
    faintest = _DISTINCT * system.close * system.ordinary
    limits = ModeLimits(0.0, faintest, np.inf, with_values(system.rows))
    _correct_modes(unit, system, work, limits)


@inner
def _correct_modes(unit: Unit, system: System, work: Work, limits: ModeLimits) -> None:
    """q += the correction along the modes that `limits` allows, Φ in r2."""
    phi = work.r2
    for r in range(phi.size):
        phi[r] = -phi[r]
        work.y[r] = 0.0
    zero(work.shift)
    finish(unit, system, work, work.shift, 1e-3, limits)
    for a in range(work.p.size):
        work.q[a] += work.shift[a]


@inner
def project(unit: Unit, system: System, work: Work, exactly: bool) -> int:
    """Bring q in `work` onto Φ = 0 along M, with Φ_q and factor at that position; returns the
    result.

    The iteration begins with Φ_q and factor of the last stage, which is near. If it converges
    slowly they are computed again. Very close to a singular position a row does not determine the
    gap of its point; then a gap that no longer falls is accepted. `exactly`: beside a singular
    position, where a last correction is made even if the rows are closed. Far from the origin Φ is
    computed with twice the digits.
    """
    size = system.size
    far = largest(work.q, work.p.size) > FAR * size
    before = np.inf
    fresh, wanting = False, exactly
    for _ in range(50):
        gap = _opening(unit, system, work, exactly or far)
        closed = gap <= CLOSED * EPS * size
        if closed or (fresh and gap > 0.5 * before and gap <= 1e-10 * size):
            if not linearise(unit, system, work, work.q):
                return NOT_CLOSED
            if not wanting:
                return OK
            wanting = False
            correct_at_last(unit, system, work)
            continue
        if fresh or gap > 0.1 * before:
            if not linearise(unit, system, work, work.q):
                return NOT_CLOSED
            fresh = True
        before = gap
        if fresh:
            correct_exactly(unit, system, work, gap, FURTHEST * size)
        else:
            correct(unit, system, work)
    return NOT_CLOSED


@expanded
def project_stage(unit: Unit, system: System, work: Work, exactly: bool) -> int:
    """Project the stage `target` onto Φ = 0, by one correction or `exactly`.

    At a distance σ from a singular position an error e of Φ turns the free directions by e / σ.
    This error, not α, breaks steps there. On Φ = 0 the equations are smooth through the position.
    The correction is linearised at q, a guess that is nearer to Φ = 0 than the stage. Φ_q and
    factor belong to that guess, or if `exactly` to the position.
    """
    if exactly:
        return _project_exactly(unit, system, work)
    assemble(unit, system, work, work.q)
    begin_correction(unit, system, work)
    if not solve_on(unit, system, work):
        return NOT_POSITIVE
    put_sum(work.target, work.delta, work.q, work.p.size)
    return OK


@inner
def begin_correction(unit: Unit, system: System, work: Work) -> None:
    """δ = -Φ_qᵀ α (Φ + Φ_q (target - q)), of the guess q in `work`."""
    rows, delta, phi, m1 = system.rows, work.delta, work.r2, system.rows.i.size
    u, g, g2 = work.shift, work.gf, work.g2f
    put_difference(work.target, work.q, u, work.p.size)
    zero(delta)
    for r in each(0, rows.both):
        i, j, d = rows.i[r], rows.j[r], block(unit, g, r)
        open_by = 0.5 * (dot(d, d) - rows.length2[r])
        v = (rows.alpha[r] * (open_by + dot(d, block(unit, u, i) - block(unit, u, j)))) * d
        subtract(delta, i, v)
        add(delta, j, v)
    for r in each(rows.both, m1):
        i, d = rows.i[r], block(unit, g, r)
        open_by = 0.5 * (dot(d, d) - rows.length2[r])
        subtract(delta, i, (rows.alpha[r] * (open_by + dot(d, block(unit, u, i)))) * d)
    if rows.movable.size == 0:
        return
    forms(unit, rows, work.q, phi)
    add_slips(unit, system, work, work.q, phi)
    for r in each(0, rows.movable.size):
        s = phi[m1 + r]
        for e in each(rows.first[r], rows.movable[r]):
            s += dot(block(unit, g2, e), block(unit, u, rows.block[e]))
        s *= rows.alpha[m1 + r]
        for e in each(rows.first[r], rows.movable[r]):
            subtract(delta, rows.block[e], s * block(unit, g2, e))


@inner
def _project_exactly(unit: Unit, system: System, work: Work) -> int:
    """Project `target` by Newton's method, with Φ to twice the digits; returns the result."""
    if not linearise(unit, system, work, work.q):
        return NOT_POSITIVE
    gap = _opening(unit, system, work, True)
    zero(work.delta)
    for a in range(work.p.size):
        work.delta[a] = work.target[a] - work.q[a]
        work.q[a] = work.target[a]
        gap = max(gap, abs(work.delta[a]))
    times_jacobian(unit, system.rows, work.g, work.g2, work.delta, work.y)
    for r in range(work.r2.size):
        work.r2[r] += work.y[r]
    before = np.inf
    for _ in range(6):
        correct_exactly(unit, system, work, gap, np.inf)
        gap = _opening(unit, system, work, True)
        if not linearise(unit, system, work, work.q):
            return NOT_POSITIVE
        if gap <= ROUNDED * EPS * system.size or gap > 0.5 * before:
            break
        before = gap
    correct_at_last(unit, system, work)
    return OK if linearise(unit, system, work, work.q) else NOT_POSITIVE

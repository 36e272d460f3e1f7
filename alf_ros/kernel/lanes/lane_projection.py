"""Projection of the ends of steps of a group onto Φ = 0: `projection.project` for lanes."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.augmented_solve import (
    DIRECTIONS,
    NOISE,
    ROUNDING,
    along_direction,
    search_of,
)
from alf_ros.kernel.data import EPS, NOTHING, ModeLimits, System, Work
from alf_ros.kernel.lanes.lane_solve import are_factored
from alf_ros.kernel.ldl import linearise
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, nowhere, pick, unless
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero
from alf_ros.kernel.projection import (
    CLOSED,
    FAINT,
    FAR,
    FURTHEST,
    ROUNDED,
    correct,
    opening,
    with_values,
)

Lanes = Any
Mask = Any

_TRIES = 50  # corrections at most, as of a single mechanism


@inner
def project_lanes(unit: Unit, system: System, work: Work, good: Mask) -> Mask:
    """Bring q in `work` onto Φ = 0 along M where `good` holds; returns the lanes where that
    succeeds. Factors are of somewhere near then.

    Lanes converge with the factor of the last stage, or wait until it is computed again. Lanes far
    from the origin do not succeed here.
    """
    size = system.size
    good = good & (largest(work.q, work.p.size) <= FAR * size)
    going, slow, before = good, good & unless(good), pick(good, np.inf, np.inf)
    copy(work.q, work.base)
    for _ in range(_TRIES):
        gap = opening(unit, system, work)
        closed = going & (gap <= CLOSED * EPS * size)
        late = going & unless(closed) & (gap > 0.1 * before)
        _keep(work, closed | late)
        slow, going = slow | late, going & unless(closed | late)
        if nowhere(going):
            break
        before = gap
        correct(unit, system, work)
    good = good & unless(going)
    copy(work.base, work.q)
    if nowhere(slow):
        return good
    before, going = pick(good, np.inf, np.inf), slow
    for _ in range(_TRIES):
        gap = opening(unit, system, work)
        closed = gap <= CLOSED * EPS * size
        closed = closed | ((gap > 0.5 * before) & (gap <= 1e-10 * size))
        going = going & unless(closed)
        if nowhere(going):
            break
        linearise(unit, system, work, work.q)
        lost = going & unless(are_factored(unit, work))
        good, going = good & unless(lost), going & unless(lost)
        before = gap
        limits = ModeLimits(
            ROUNDED * EPS * size, FAINT * gap / size, FURTHEST * size, with_values(system.rows)
        )
        _correct_exactly(unit, system, work, limits, going)
    return good & unless(going)


@inner
def _keep(work: Work, where: Mask) -> None:
    """Keep q in `base` where `where` holds."""
    if anywhere(where):
        for i in range(work.p.size):
            work.base[i] = pick(where, work.q[i], work.base[i])


@inner
def _correct_exactly(
    unit: Unit, system: System, work: Work, limits: ModeLimits, going: Mask
) -> None:
    """`projection.correct_exactly`, Φ in r2."""
    phi = work.r2
    for r in range(phi.size):
        phi[r] = -phi[r]
    zero(work.shift)
    _finish(unit, system, work, work.shift, limits, going)
    for a in range(work.p.size):
        work.q[a] = pick(going, work.q[a] + work.shift[a], work.q[a])


@inner
def _finish(
    unit: Unit, system: System, work: Work, x: Floats, limits: ModeLimits, going: Mask
) -> None:
    """`augmented_solve.finish`, of x alone, to 1e-3."""
    rows, delta, r2, z, w = system.rows, work.delta, work.r2, work.z, work.w
    n, m = np.uint64(work.p.size), np.uint64(r2.size)
    towards, image, _ = search_of(work.search, n, m)
    before = pick(going, np.inf, np.inf)
    for _ in range(DIRECTIONS):
        rho, square = 0.0, 0.0
        for r in range(m):
            z[r] = rows.alpha[r] * r2[r]
            rho += r2[r] * z[r]
        floor = max(max(limits.noise, NOISE * largest(x, n)), NOTHING)
        going = going & unless(rho <= system.penalty * system.mean * floor * floor)
        if nowhere(going):
            return
        zw, zz = along_direction(unit, system, work)
        going = going & (zw > ROUNDING * zz)
        part = zw / before
        for r in range(m):
            image[r] = w[r] + part * image[r]
            if r >= limits.unbound:
                image[r] = pick(r2[r] == 0.0, 0.0 * image[r], image[r])
            square += rows.alpha[r] * image[r] * image[r]
        for i in range(n):
            towards[i] = delta[i] + part * towards[i]
        beta, eigenvalue = zw / square, square / zw
        sigma = np.sqrt(eigenvalue / (system.penalty * max(1.0 - eigenvalue, EPS)))
        going = going & unless(sigma < limits.faintest)
        going = going & unless(beta * largest(towards, n) > limits.furthest * sigma)
        if nowhere(going):
            return
        step, size = 0.0, 0.0
        for i in range(n):
            x[i] = pick(going, x[i] + beta * towards[i], x[i])
            step, size = max(step, abs(towards[i])), max(size, abs(x[i]))
        for r in range(m):
            r2[r] -= beta * image[r]
        going = going & unless(abs(beta) * step <= 1e-3 * size)
        before = zw

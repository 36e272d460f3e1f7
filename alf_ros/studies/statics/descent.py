"""The way to a position of rest: down the potential on the positions that the rows allow.

Each step solves the Newton equations of min V on Φ = 0 by the method of multipliers,

    [H + Jᵀ α J + μ M] dq = Q - Jᵀ λ,   H = K + Σ λ_k H_k,

then closes the mechanism again. μ M is a trust region in the metric of the mass: it grows until
the matrix is positive definite over redundant rows and singular positions, and until the forces
do about the work that the model of second order foretells. So V falls from step to step, and the
mechanism stays on the assembly it starts from. The work is the integral of Q along the step: this
needs no potential, and for loads that have none it says whether the step goes the way they push.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model.assembly import displaced
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.instant import Instant, counted

_STEPS = 250  # at most
_LONGEST = 0.15  # of a step, in parts of a typical length: angles turn by less than a quarter
_AT_REST = 1e-14  # acceleration, of what the forces would give without rows, that is rounding
_RESTS = 1e-9  # and that counts as rest if it falls no further
_PATIENT = 4  # steps without progress
_LEAST = 1e-12  # μ, of the largest rate² of S
_ROUNDED = 4.0 * float(np.finfo(float).eps)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True, eq=False)
class Landing:
    """Where a descent ended: the instant, λ (rows,) in the kernel's order, the acceleration left
    (m/s², the largest), that without rows, the number of steps, and whether it is at rest."""

    instant: Instant
    lam: Floats
    left: float
    scale: float
    steps: int

    @property
    def rests(self) -> bool:
        """Whether nothing accelerates."""
        return self.left <= _RESTS * self.scale


def pushed(instant: Instant, solve: ConstrainedSolve) -> tuple[Floats, Floats]:
    """q̈ (n,) from rest, m/s², and λ (rows,): M q̈ + Jᵀ λ = Q, J q̈ = 0."""
    J = instant.J[:, : instant.model.n].tocsr()
    if not solve.factorise(instant.M, J, instant.q):
        raise AssemblyError('a point that moves has neither mass nor constraint', key='points')
    return solve.solve(instant.Q[: instant.model.n], np.zeros(J.shape[0]))


def free_rate(instant: Instant) -> float:
    """The largest acceleration that the forces would give without rows, m/s²."""
    model = instant.model
    mass = np.repeat(model.system.mass.diagonal, model.layout.dimension)
    mass = np.where(mass > 0.0, mass, model.system.mean)
    return float(np.abs(instant.Q[: model.n] / mass).max(initial=0.0))


def moved(instant: Instant, step: Floats) -> Instant:
    """The instant after a displacement (n,), m, closed again. Raises AssemblyError."""
    whole = np.zeros_like(instant.q)
    whole[: instant.model.n] = step
    q = displaced(instant.model, instant.q, whole)
    return replace(instant, q=q, turns=counted(instant.model, instant.q, instant.turns, q))


def descended(instant: Instant) -> Landing:
    """Where the loads bring a mechanism from rest at an instant. Raises AssemblyError if something
    that moves has neither mass nor constraint."""
    model = instant.model
    solve = ConstrainedSolve(model, instant.loads.tangents.cliques)
    mu, best, idle, scale = 0.0, None, 0, 0.0
    for steps in range(_STEPS):
        pull, lam = pushed(instant, solve)
        scale = max(scale, free_rate(instant))
        landing = Landing(instant, lam, float(np.abs(pull).max(initial=0.0)), scale, steps)
        idle = 0 if best is None or landing.left < 0.5 * best.left else idle + 1
        if best is None or landing.left <= best.left:
            best = landing
        if landing.left <= _AT_REST * scale or (idle > _PATIENT and best.rests):
            break
        following = _step(landing, solve, mu)
        if following is None:
            break
        instant, mu = following
    assert best is not None
    return replace(best, scale=scale)


def _step(landing: Landing, solve: ConstrainedSolve, mu: float) -> tuple[Instant, float] | None:
    """The next instant and its μ, 1/s²; None if no step helps."""
    instant, lam, model = landing.instant, landing.lam, landing.instant.model
    J, n = instant.J[:, : model.n].tocsr(), model.n
    H = instant.K + instant.curvature(lam)
    H = 0.5 * (H + H.T)
    mass = np.repeat(model.system.mass.diagonal, model.layout.dimension)
    mass = np.where(mass > 0.0, mass, model.system.mean)
    rate = float((np.asarray(np.abs(H).sum(axis=1)).ravel() / mass).max(initial=0.0))
    rate = max(rate, landing.left / model.size)
    longest = _LONGEST * instant.loads.tangents.length
    mu = max(mu, _LEAST * rate)
    nothing = np.zeros(J.shape[0])
    for _ in range(80):
        good = solve.factorise((H + mu * instant.M).tocsr(), J, instant.q)
        if good:
            dq, _ = solve.solve(instant.Q[:n], nothing)
            good = float(np.abs(dq).max(initial=0.0)) <= longest
        if not good:
            mu = max(4.0 * mu, 1e-6 * rate)
            continue
        try:
            following = moved(instant, dq)
        except AssemblyError:
            mu = max(4.0 * mu, 1e-6 * rate)
            continue
        change = following.q - instant.q
        foretold = float(instant.Q[:n] @ dq - 0.5 * dq @ (H @ dq))
        work, rounding = _work(instant, change)
        if work < 0.1 * foretold - rounding:
            mu = max(4.0 * mu, 1e-6 * rate)
            continue
        return following, (0.25 * mu if work > 0.7 * foretold - rounding else mu)
    return None


def _work(instant: Instant, change: Floats) -> tuple[float, float]:
    """∫ Q · dq along a displacement (blocks D,), J, and what rounding leaves of it."""
    n, work, size = instant.model.n, 0.0, 0.0
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        Q = instant.force(instant.q + 0.5 * (1.0 + node) * change, instant.qd)
        work += 0.5 * weight * float(Q[:n] @ change[:n])
        size = max(size, float(np.abs(Q[:n]).max(initial=0.0)))
    # positions are closed to rounding of the size: of energy no more than that is known
    return work, _ROUNDED * size * n * (instant.model.size + float(np.abs(change).max()))

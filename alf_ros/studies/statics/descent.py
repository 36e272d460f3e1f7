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
from functools import cached_property

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model.assembly import displaced
from alf_ros.model.massless_directions import no_mass
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.instant import Instant, counted
from alf_ros.studies.statics.sparse_rows import Sparse

_STEPS = 2000  # at most: contacts and stops take many short ones
# of all steps together, in sizes of the mechanism: loads may turn a wheel for ever
_FARTHEST = 20.0
_LONGEST = 0.15  # of a step, in parts of a typical length: angles turn by less than a quarter
_AT_REST = 1e-14  # acceleration, of what the forces would give without rows, that is rounding
_RESTS = 1e-9  # and that counts as rest if it falls no further
_PATIENT = 4  # steps without progress
_BACK = 25  # steps back into a valley, at most
_LEAST = 1e-12  # μ, of the largest rate² of S
_ROUNDED = 4.0 * float(np.finfo(float).eps)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True, eq=False)
class Landing:
    """Where a search ended: the instant, λ (rows,) in the kernel's order, the acceleration left
    (m/s², the largest), the acceleration of the same forces without rows, the number of steps."""

    instant: Instant
    lam: Floats
    left: float
    scale: float
    steps: int

    @property
    def rests(self) -> bool:
        """Whether nothing accelerates, but for what rounding of the position makes."""
        rounding = _ROUNDED * self.rate * self.instant.model.size
        return self.left <= _RESTS * self.scale + rounding

    @cached_property
    def hessian(self) -> Sparse:
        """(n, n) K + Σ λ_k H_k without its skew part, N/m."""
        H = self.instant.K + self.instant.curvature(self.lam)
        return 0.5 * (H + H.T)

    @cached_property
    def rate(self) -> float:
        """A bound of ω² of the hessian, 1/s²."""
        sums = np.asarray(np.abs(self.hessian).sum(axis=1)).ravel()
        return float((sums / _masses(self.instant)).max(initial=0.0))


def landed(instant: Instant, solve: ConstrainedSolve, steps: int) -> Landing:
    """A landing at an instant. Raises AssemblyError as `pushed` does."""
    pull, lam = pushed(instant, solve)
    left = float(np.abs(pull).max(initial=0.0))
    return Landing(instant, lam, left, free_rate(instant), steps)


def free_rate(instant: Instant) -> float:
    """The largest acceleration that the forces would give without rows, m/s²."""
    return float(np.abs(instant.Q[: instant.model.n] / _masses(instant)).max(initial=0.0))


def _masses(instant: Instant) -> Floats:
    """(n,) kg; the mean of a point without mass."""
    system, D = instant.model.system, instant.model.layout.dimension
    masses = np.repeat(system.mass.diagonal, D)
    return np.where(masses > 0.0, masses, system.mean)


def pushed(instant: Instant, solve: ConstrainedSolve) -> tuple[Floats, Floats]:
    """q̈ (n,) from rest, m/s², and λ (rows,): M q̈ + Jᵀ λ = Q, J q̈ = 0."""
    J = instant.J[:, : instant.model.n].tocsr()
    if not solve.factorise(instant.M, J, instant.q):
        raise no_mass(instant.model, instant.q)
    return solve.solve(instant.Q[: instant.model.n], np.zeros(J.shape[0]))


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
    mu, best, idle, far = 0.0, None, 0, 0.0
    for steps in range(_STEPS):
        landing = landed(instant, solve, steps)
        idle = 0 if best is None or landing.left < 0.5 * best.left else idle + 1
        if best is None or landing.left <= best.left:
            best = landing
        if landing.left <= _AT_REST * landing.scale or (idle > _PATIENT and best.rests):
            break
        following = _step(landing, solve, mu)
        if following is None:
            break
        far += float(np.abs(following[0].q - instant.q).max(initial=0.0))
        instant, mu = following
        if far > _FARTHEST * model.size:
            break
    assert best is not None
    return best


@dataclass(frozen=True, eq=False)
class _Trial:
    """A step that was tried, and where it ends. work: of the forces, J. foretold: by the
    model of second order, J. rounding: of both, J."""

    end: Instant
    work: float
    foretold: float
    rounding: float

    def keeps(self, part: float) -> bool:
        """Whether the work is this part of the foretold work."""
        return self.work >= part * self.foretold - self.rounding


def _step(landing: Landing, solve: ConstrainedSolve, mu: float) -> tuple[Instant, float] | None:
    """The next instant and its μ, 1/s²; None if no step helps."""
    instant, H = landing.instant, landing.hessian
    rate = max(landing.rate, landing.left / instant.model.size)
    mu = max(mu, _LEAST * rate)
    for _ in range(80):
        trial = _tried(instant, H, solve, mu)
        if trial is not None and trial.keeps(0.7):
            return trial.end, 0.25 * mu
        if trial is not None:
            back = _back_in_the_valley(trial, solve, mu)
            if back is not None:
                return back, 0.5 * mu
            if trial.keeps(0.1):
                return trial.end, mu
        mu = max(4.0 * mu, 1e-6 * rate)
    return None


def _back_in_the_valley(trial: _Trial, solve: ConstrainedSolve, mu: float) -> Instant | None:
    """The instant after more steps, if these make the work enough that the first step lacks.

    Stiff contacts make a narrow and curved valley of V. A long step along the valley leaves it,
    and the next ones lead back to its floor (the watchdog technique: Chamberlain, Powell,
    Lemarechal & Pedersen 1982).
    """
    work, instant = trial.work, trial.end
    for _ in range(_BACK):
        following = _tried(instant, landed(instant, solve, 0).hessian, solve, mu)
        if following is None or not following.work > 0.0:
            return None
        work, instant = work + following.work, following.end
        if work >= 0.7 * trial.foretold:
            return instant
    return None


def _tried(instant: Instant, H: Sparse, solve: ConstrainedSolve, mu: float) -> _Trial | None:
    """The step with μ; None if the matrix is not positive or the step leads too far."""
    n = instant.model.n
    J = instant.J[:, :n].tocsr()
    if not solve.factorise((H + mu * instant.M).tocsr(), J, instant.q):
        return None
    dq, _ = solve.solve(instant.Q[:n], np.zeros(J.shape[0]))
    if not float(np.abs(dq).max(initial=0.0)) <= _LONGEST * instant.loads.tangents.length:
        return None
    try:
        end = moved(instant, dq)
    except AssemblyError:
        return None
    work, rounding = _work(instant, end.q - instant.q)
    return _Trial(end, work, float(instant.Q[:n] @ dq - 0.5 * dq @ (H @ dq)), rounding)


def _work(instant: Instant, change: Floats) -> tuple[float, float]:
    """∫ Q · dq along a displacement (blocks D,), J, and what rounding leaves of it."""
    n, work, size = instant.model.n, 0.0, 0.0
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        Q = instant.force(instant.q + 0.5 * (1.0 + node) * change, instant.qd)
        work += 0.5 * weight * float(Q[:n] @ change[:n])
        size = max(size, float(np.abs(Q[:n]).max(initial=0.0)))
    # positions are closed to rounding of the size: of energy no more than that is known
    return work, _ROUNDED * size * n * (instant.model.size + float(np.abs(change).max()))

"""The way to a position of rest: down the potential on the positions that the rows allow.

Each step solves the Newton equations of min V on Φ = 0 by the method of multipliers,

    [H + Jᵀ α J + μ W] dq = Q - Jᵀ λ,   H = K + Σ λ_k H_k,

then closes the mechanism again. μ W is a trust region: it grows until the matrix is positive
definite over redundant rows and singular positions, and until the forces do about the work that
the model of second order foretells. So V falls from step to step, and the mechanism stays on the
assembly it starts from. The work is the integral of Q along the step: this needs no potential, and
for loads that have none it says whether the step goes the way they push. W is M; where the search
gets long, it is the metric of turning (`step_metric`).

Parts of the mechanism that nothing connects are judged each by its own forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model.assembly import displaced
from alf_ros.model.massless_directions import no_mass
from alf_ros.studies.statics.connected_parts import ConnectedParts
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.instant import Instant, counted
from alf_ros.studies.statics.sparse_rows import Sparse
from alf_ros.studies.statics.step_metric import StepMetric, of_mass, of_turning, reach_of

_STEPS = 2000  # at most: contacts and stops take many short ones
_LONG = 100  # steps, from which on a search is long
# of all steps together, in reaches of the mechanism: loads may turn a wheel for ever
_FARTHEST = 20.0
_AT_REST = 1e-14  # acceleration, of what the forces would give without rows, that is rounding
_RESTS = 1e-9  # and that counts as rest if it falls no further
_PATIENT = 4  # steps without progress
_BACK = 25  # steps back into a valley, at most
_LEAST = 1e-12  # μ, of the largest rate² of S
_ROUNDED = 4.0 * float(np.finfo(float).eps)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


# why a search ended
RESTS, LIMIT, FAR, STUCK = 'rests', 'limit', 'far', 'stuck'


@dataclass(frozen=True, eq=False)
class Landing:
    """Where a search ended: the instant, λ (rows,) in the kernel's order, and of each part the
    acceleration left (m/s², the largest) and the acceleration of the same forces without rows.

    steps: of the search. ending: RESTS, LIMIT (of the steps), FAR (it moved and moved), or STUCK
    (no step goes further down).
    """

    instant: Instant
    lam: Floats
    parts: ConnectedParts
    lefts: Floats
    scales: Floats
    steps: int
    ending: str = RESTS

    @property
    def left(self) -> float:
        """The largest acceleration left, m/s²."""
        return float(self.lefts.max(initial=0.0))

    @property
    def rests(self) -> bool:
        """Whether nothing accelerates, but for what rounding of the position makes."""
        rounding = _ROUNDED * self.rates * self.instant.model.size
        return bool((self.lefts <= _RESTS * self.scales + rounding).all())

    @property
    def is_exact(self) -> bool:
        """Whether only rounding of the forces accelerates."""
        return bool((self.lefts <= _AT_REST * self.scales).all())

    @cached_property
    def hessian(self) -> Sparse:
        """(n, n) K + Σ λ_k H_k without its skew part, N/m."""
        H = self.instant.K + self.instant.curvature(self.lam)
        return 0.5 * (H + H.T)

    @cached_property
    def rates(self) -> Floats:
        """(parts,) a bound of ω² of the hessian, 1/s²."""
        sums = np.asarray(np.abs(self.hessian).sum(axis=1)).ravel()
        return self.parts.largest(sums / _masses(self.instant))

    @property
    def rate(self) -> float:
        """The largest of them."""
        return float(self.rates.max(initial=0.0))


def landed(instant: Instant, solve: ConstrainedSolve, steps: int) -> Landing:
    """A landing at an instant. Raises AssemblyError as `pushed` does."""
    pull, lam = pushed(instant, solve)
    parts, free = solve.parts, instant.Q[: instant.model.n] / _masses(instant)
    return Landing(instant, lam, parts, parts.largest(pull), parts.largest(free), steps)


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
    J = instant.J_of_movable
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
    model, tangents = instant.model, instant.loads.tangents
    metric = of_mass(model, tangents.length)
    solve = ConstrainedSolve(model, tangents.cliques)
    farthest = _FARTHEST * reach_of(model, tangents.length)
    mu, best, idle, far, ending = 0.0, None, 0, 0.0, LIMIT
    scales: Floats = np.zeros(solve.parts.count)  # the largest so far
    for steps in range(_STEPS):
        if steps == _LONG:
            metric, mu = of_turning(model, tangents.length), 0.0
            solve = ConstrainedSolve(model, [*tangents.cliques, *metric.cliques])
        landing = landed(instant, solve, steps)
        scales = np.maximum(scales, landing.scales)
        left, least = _unrest(landing, scales), np.inf if best is None else _unrest(best, scales)
        idle = 0 if best is None or left < 0.5 * least else idle + 1
        if best is None or left <= least:
            best = landing
        if landing.is_exact or (idle > _PATIENT and best.rests):
            ending = RESTS
            break
        following = _step(landing, solve, metric, mu)
        if following is None:
            ending = STUCK
            break
        far += float(np.abs(following[0].q - instant.q).max(initial=0.0))
        instant, mu = following
        if far > farthest:
            ending = FAR
            break
    assert best is not None
    return replace(best, ending=RESTS if best.rests else ending, steps=steps)


def _unrest(landing: Landing, scales: Floats) -> float:
    """The accelerations left over scales (parts,), m/s²; the largest of the parts."""
    return float((landing.lefts / np.where(scales > 0.0, scales, np.inf)).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Trial:
    """A step that was tried, and where it ends. Of each part (parts,), J: the work of the forces,
    the work foretold by the model of second order, the rounding of both."""

    end: Instant
    work: Floats
    foretold: Floats
    rounding: Floats

    def keeps(self, part: float) -> bool:
        """Whether the work is this part of the foretold work."""
        return bool((self.work >= part * self.foretold - self.rounding).all())


def _step(
    landing: Landing, solve: ConstrainedSolve, metric: StepMetric, mu: float
) -> tuple[Instant, float] | None:
    """The next instant and its μ, 1/s²; None if no step helps."""
    instant, H = landing.instant, landing.hessian
    rate = max(landing.rate, landing.left / instant.model.size)
    mu = max(mu, _LEAST * rate)
    for _ in range(80):
        trial = _tried(instant, H, solve, metric, mu)
        if trial is not None and trial.keeps(0.7):
            return trial.end, 0.25 * mu
        if trial is not None:
            back = _back_in_the_valley(trial, solve, metric, mu)
            if back is not None:
                return back, 0.5 * mu
            if trial.keeps(0.1):
                return trial.end, mu
        mu = max(4.0 * mu, 1e-6 * rate)
    return None


def _back_in_the_valley(
    trial: _Trial, solve: ConstrainedSolve, metric: StepMetric, mu: float
) -> Instant | None:
    """The instant after more steps, if these make the work enough that the first step lacks.

    Stiff contacts make a narrow and curved valley of V. A long step along the valley leaves it,
    and the next ones lead back to its floor (the watchdog technique: Chamberlain, Powell,
    Lemarechal & Pedersen 1982).
    """
    work, instant = trial.work, trial.end
    for _ in range(_BACK):
        following = _tried(instant, landed(instant, solve, 0).hessian, solve, metric, mu)
        if following is None or not float(following.work.sum()) > 0.0:
            return None
        work, instant = work + following.work, following.end
        if (work >= 0.7 * trial.foretold - trial.rounding).all():
            return instant
    return None


def _tried(
    instant: Instant, H: Sparse, solve: ConstrainedSolve, metric: StepMetric, mu: float
) -> _Trial | None:
    """The step with μ; None if the matrix is not positive or the step leads too far."""
    n, parts = instant.model.n, solve.parts
    J = instant.J_of_movable
    if not solve.factorise((H + mu * metric.matrix).tocsr(), J, instant.q):
        return None
    dq, _ = solve.solve(instant.Q[:n], np.zeros(J.shape[0]))
    if not metric.allows(dq):
        return None
    try:
        end = moved(instant, dq)
    except AssemblyError:
        return None
    work, rounding = _work(instant, end.q - instant.q, parts)
    foretold = parts.sums(instant.Q[:n] * dq - 0.5 * dq * (H @ dq))
    return _Trial(end, work, foretold, rounding)


def _work(instant: Instant, change: Floats, parts: ConnectedParts) -> tuple[Floats, Floats]:
    """(parts,) ∫ Q · dq along a displacement (blocks D,), J, and what rounding leaves of it."""
    n = instant.model.n
    work: Floats = np.zeros(parts.count)
    size: Floats = np.zeros(parts.count)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        Q = instant.force(instant.q + 0.5 * (1.0 + node) * change, instant.qd)[:n]
        work += 0.5 * weight * parts.sums(Q * change[:n])
        size = np.maximum(size, parts.largest(Q))
    # positions are closed to rounding of the size: of energy no more than that is known
    far = instant.model.size + float(np.abs(change).max(initial=0.0))
    return work, _ROUNDED * far * size * parts.sums(np.ones(n))

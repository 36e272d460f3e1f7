"""The nearest position of rest of any kind, by Newton's method on the free directions.

Unstable positions and loads without a potential have no descent that ends there. Newton's method
on g = Zᵀ Q = 0 does not ask for one, and needs no symmetric matrix K' = Zᵀ (K + L) Z. Its step
shortens g, the force in the metric of M⁻¹, if it is short enough; so it is halved until it does.

Where K' is singular, Newton's step may be endless or zero. Then the damped step
(K'ᵀ K' + τ²)⁻¹ K'ᵀ g is tried (Levenberg 1944, Marquardt 1963). Where K'ᵀ g = 0, as in a pendulum
that is drawn horizontally, |g| is stationary, and a step along the directions without stiffness
shortens it: first the way the forces push. If nothing shortens g, the search goes down the
potential from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.descent import Landing, descended, landed, moved, pushed
from alf_ros.studies.statics.instant import Instant
from alf_ros.studies.statics.rest_stability import reduced_stiffness

_STEPS = 60
_LONGEST = 0.3  # of a typical length
_HALVES = 12
_SMALL = 1e-10  # singular value, of the largest, from which down a direction is neutral
_SOFT = 1e-3  # and from which down a direction is tried on its own
_DAMPED = (1e-3, 1e-2, 1e-1, 1.0)  # τ, of the largest singular value


def nearest_rest(instant: Instant) -> Landing:
    """Where Newton's method leads from an instant at rest; where it ends without rest, the descent
    from there. Raises InputError for a mechanism too large for dense matrices, AssemblyError if
    something has neither mass nor constraint."""
    solve = ConstrainedSolve(instant.model, instant.loads.tangents.cliques)
    best = landed(instant, solve, 0)
    scales = np.where(best.scales > 0.0, best.scales, 1.0)
    for steps in range(1, _STEPS):
        if best.is_exact:
            return best
        better = _nearer(best, solve, scales, steps)
        if better is None:
            break
        best = better
    if best.rests:
        return best
    below = descended(best.instant)
    return replace(below, steps=best.steps + below.steps)


def _nearer(best: Landing, solve: ConstrainedSolve, scales: Floats, steps: int) -> Landing | None:
    """A landing with less force; None if none is found."""
    here = best.instant
    longest = _LONGEST * here.loads.tangents.length
    least = _force(here, solve, scales)
    for direction in _directions(best):
        farthest = float(np.abs(direction).max(initial=0.0))
        if not farthest > 0.0:
            continue
        dq = direction * min(1.0, longest / farthest)
        for _ in range(_HALVES):
            try:
                there = moved(here, dq)
                if _force(there, solve, scales) < least:
                    return landed(there, solve, steps)
            except AssemblyError:
                pass
            dq = 0.5 * dq
    return None


def _force(instant: Instant, solve: ConstrainedSolve, scales: Floats) -> float:
    """|g|², the parts of the mechanism over their scales (parts,), m/s²; kg."""
    pull, _ = pushed(instant, solve)
    return float((solve.parts.sums(pull * (instant.M @ pull)) / scales**2).sum())


def _directions(best: Landing) -> Iterator[Floats]:
    """Steps (n,), m, to try one after another."""
    here, Z = best.instant, best.instant.velocity_directions
    K = reduced_stiffness(here, best.lam).matrix
    g = Z.T @ here.Q[: here.model.n]
    yield Z @ np.linalg.lstsq(K, g, rcond=_SMALL)[0]
    if best.rests:
        return
    U, s, Vt = np.linalg.svd(K)
    largest = float(s.max(initial=0.0))
    for part in _DAMPED if largest > 0.0 else ():
        yield Z @ (Vt.T @ (s / (s**2 + (part * largest) ** 2) * (U.T @ g)))
    # directions have no length of their own: as far as a step may go
    soft = Vt[s <= _SOFT * largest]
    far = here.model.size / max(float(np.abs(Z).max(initial=0.0)), 1e-300)
    for along in (soft.T @ (soft @ g), *soft[::-1]):
        size = float(np.linalg.norm(along))
        if size > 0.0:
            ahead = far / size * (Z @ along) * (1.0 if along @ g >= 0.0 else -1.0)
            yield ahead
            yield -ahead

"""The nearest position of rest of any kind, by Newton's method on the free directions.

Unstable positions and loads without a potential have no descent that ends there. Newton's method
on Zᵀ Q = 0 does not ask for one, and needs no symmetric matrix. Where it does not come nearer, a
shorter step is tried (by halves), so that it may end where there is no position of rest.
"""

from __future__ import annotations

import numpy as np

from alf_ros.errors import AssemblyError
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.descent import Landing, landed, moved
from alf_ros.studies.statics.instant import Instant
from alf_ros.studies.statics.rest_stability import reduced_stiffness

_STEPS = 60
_LONGEST = 0.3  # of a typical length
_SMALL = 1e-10  # singular value, of the largest, from which down a direction is neutral
_AT_REST = 1e-14


def nearest_rest(instant: Instant) -> Landing:
    """Where Newton's method leads from an instant at rest. Raises InputError for a mechanism too
    large for dense matrices, AssemblyError if something has neither mass nor constraint."""
    solve = ConstrainedSolve(instant.model, instant.loads.tangents.cliques)
    longest = _LONGEST * instant.loads.tangents.length
    best = landed(instant, solve, 0)
    for steps in range(1, _STEPS):
        if best.left <= _AT_REST * best.scale:
            break
        here, Z = best.instant, best.instant.velocity_directions
        K = reduced_stiffness(here, best.lam).matrix
        along = np.linalg.lstsq(K, Z.T @ here.Q[: here.model.n], rcond=_SMALL)[0]
        dq = Z @ along
        dq *= min(1.0, longest / max(float(np.abs(dq).max(initial=0.0)), 1e-300))
        better = None
        for _ in range(12):
            try:
                there = landed(moved(here, dq), solve, steps)
                if there.left < best.left:
                    better = there
                    break
            except AssemblyError:
                pass
            dq *= 0.5
        if better is None:
            break
        best = better
    return best

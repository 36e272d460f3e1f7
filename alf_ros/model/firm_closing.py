"""Places that lie a little beside the way of a mechanism, as rows hold a direction to second order
only: they open by about v² along such a direction v, so a walk hardly feels it."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.closing_newton import settle
from alf_ros.model.compile import allocate
from alf_ros.model.free_walk import EXACT, Walk
from alf_ros.model.rank import effective_rank

# one after the other: what the first ones leave is too near for the last ones to overshoot; they
# feel σ, which is about v, down to 1e-7, where rows open by no more than rounding
_PENALTIES = 1e12, 1e13, 1e14, 1e15
_SOFT, _FIRM = 1e14, 1e6  # penalties that tell σ above 1e-7, and above 1e-3
_LOOKED_AT = 32  # places, at most
_NEAR = 0.05  # of the way to a place, within which it closes
_ENOUGH = 0.25  # of the places that are open


def lie_beside(walk: Walk, q: Floats, places: list[Floats]) -> bool:
    """Whether enough of the open places of a walk from q (blocks D, m) lie so: rows close near by.

    Where lengths contradict each other by e nothing near by closes, or only at v of about √e, with
    a row as soft as that.
    """
    open_ = [place for place in places if walk.excess([place]) > EXACT]
    some = open_[:: 1 + len(open_) // _LOOKED_AT]
    closes = _Closing(walk)
    count = sum(closes(place, _NEAR * np.abs(place - q).max()) for place in some)
    return count > _ENOUGH * len(some)


class _Closing:
    """Closes places with firmer and firmer penalties."""

    def __init__(self, walk: Walk) -> None:
        self._walk = walk
        self._telling = [walk.model.with_penalty(penalty) for penalty in (_SOFT, _FIRM)]
        self._models = [walk.model.with_penalty(penalty) for penalty in _PENALTIES]
        self._work = allocate(walk.model, walk.model.system, 0)
        self._phi, self._gap = np.empty((2, len(walk.model.row_names)))

    def __call__(self, place: Floats, near: float) -> bool:
        """Whether rows close within a distance `near` (m) of a place (blocks D, m), and none is
        soft there."""
        work = self._work
        work.q[:] = place
        for model in self._models:
            settle(model.unit, model.system, work, 0.0, work.q.copy(), self._phi, self._gap)
        if np.abs(work.q - place).max() > near or self._walk.excess([work.q]) > EXACT:
            return False
        ranks = []
        for model in self._telling:
            if not kernel.linearise(model.unit, model.system, work, work.q):
                return False
            ranks.append(effective_rank(model, work))
        return ranks[0] - ranks[1] < 0.5

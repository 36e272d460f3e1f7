"""A branch through singular positions: places close together, with a polynomial between them.

In a singular position branches meet, and a step that leads over it may end on another one. The
polynomial through places before it leads to those behind it on the same branch.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alf_ros.arrays import Floats

_NODES = 6  # that a step follows
BETWEEN = 7  # that a position between places follows: a branch needs as many
_PARTS = 1.0, 1.5, 2.25  # of a step, where the one before comes too near to a singular position
_MOVED = 0.2  # part of a step by which closing may move a place


class SmoothBranch:
    """Places (blocks D, m) and their distances s (m) along the branch from the first of them."""

    def __init__(self, start: Floats) -> None:
        self.s, self.places = [0.0], [start]

    def follow(
        self,
        direction: Floats,
        step: float,
        length: float,
        closed: Callable[[Floats], Floats | None],
    ) -> None:
        """Add places about a step (m) apart up to a length (m), at first in a direction (unit).

        `closed` closes a position, or returns None. Ends early where the branch does, or where it
        cannot be followed.
        """
        while self.s[-1] < length:
            place = self._next(direction, step, closed)
            if place is None:
                return
            self.s.append(self.s[-1] + float(np.linalg.norm(place - self.places[-1])))
            self.places.append(place)

    def _next(
        self, direction: Floats, step: float, closed: Callable[[Floats], Floats | None]
    ) -> Floats | None:
        """The place a step ahead of the last, or a little further where it cannot be closed."""
        for part in _PARTS:
            ahead = part * step
            if len(self.s) < 2:
                guess = self.places[-1] + ahead * direction
            else:
                guess = self._polynomial(self.s[-1] + ahead, _NODES)[0]
            place = closed(guess)
            if place is not None and float(np.linalg.norm(place - guess)) < _MOVED * ahead:
                return place
        return None

    def at(self, s: float) -> Floats:
        """The position at s (m) and its first three derivatives by s, (4, blocks D);
        of a branch of `BETWEEN` places at least."""
        derivatives = self._polynomial(s, BETWEEN)[:4]
        return derivatives * np.array([1.0, 1.0, 2.0, 6.0])[:, None]

    def _polynomial(self, s: float, count: int) -> Floats:
        """Coefficients about s of the polynomial through so many places next to s."""
        x = np.array(self.s) - s
        nearest = np.argsort(np.abs(x))[:count]
        reach = float(np.abs(x[nearest]).max())
        nodes = np.vander(x[nearest] / reach, increasing=True)
        found = np.linalg.solve(nodes, np.array([self.places[k] for k in nearest]))
        return np.asarray(found / reach ** np.arange(len(nearest))[:, None])

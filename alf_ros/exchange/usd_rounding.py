"""Places and axes of a USD stage as they were before single precision moved them.

Loops need axes that are parallel, and a body cannot have two places with hardly a distance.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from alf_ros.arrays import Floats

_AROUND = np.array(list(product((-1, 0, 1), repeat=3)))


class Triples:
    """Triples of numbers, each of which stands for all within `tolerance` of it."""

    def __init__(self, tolerance: float) -> None:
        self._tolerance, self._cell = tolerance, tolerance or 1.0
        self._cells: dict[tuple[float, ...], list[Floats]] = {}

    def find(self, triple: Floats) -> Floats | None:
        """The known triple that a new one is, if there is one."""
        for cell in np.floor(triple / self._cell) + _AROUND:
            for known in self._cells.get(tuple(cell), ()):
                if np.linalg.norm(known - triple) <= self._tolerance:
                    return known
        return None

    def same(self, triple: Floats) -> Floats:
        """The known triple that a new one is, or the new one, which is known from then on."""
        found = self.find(triple)
        if found is None:
            found = triple
            self._cells.setdefault(tuple(np.floor(triple / self._cell)), []).append(triple)
        return found

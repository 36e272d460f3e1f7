"""The parts of a mechanism that neither rows, masses nor effects connect.

What happens in one part does not depend on the others. So each part is judged by its own forces: a
force in another part, however large, says nothing of its rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components

from alf_ros.arrays import Floats, Integers


@dataclass(frozen=True, eq=False)
class ConnectedParts:
    """of (n,): the part of each coordinate. count: of parts."""

    of: Integers
    count: int

    def largest(self, sizes: Floats) -> Floats:
        """(parts,) the largest magnitude of numbers (n,) in each part."""
        found = np.zeros(self.count)
        np.maximum.at(found, self.of, np.abs(sizes))
        return found

    def sums(self, numbers: Floats) -> Floats:
        """(parts,) of numbers (n,)."""
        return np.asarray(np.bincount(self.of, numbers, self.count), dtype=float)


def parts_of(i: Integers, j: Integers, blocks: int, dimension: int) -> ConnectedParts:
    """Of blocks, of which the pairs (i, j) are connected."""
    graph = sparse.coo_matrix((np.ones(i.size), (i, j)), (blocks, blocks))
    count, of = connected_components(graph, directed=False)
    return ConnectedParts(np.repeat(of.astype(np.int64), dimension), int(count))


def one_part(n: int) -> ConnectedParts:
    """All of n coordinates as one part."""
    return ConnectedParts(np.zeros(n, dtype=np.int64), 1)

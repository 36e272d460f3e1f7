"""The mass that a light block carries: rows of a light part between heavy ones hold these too.

The penalty of a row is as large as the mass of its lightest block. A link almost without inertia
between two heavy ones, as many URDF have, would bind these by rows far too soft. A light
part at the end of a chain holds only itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Rows
from alf_ros.mechanism.natural_coordinates import Layout

_LIGHT = 1e-6  # of the mass that is carried: a row with less mass would not hold it


class CarriedMasses:
    """The masses that the blocks of a mechanism carry, for any masses of its bodies."""

    def __init__(self, layout: Layout, rows: Rows) -> None:
        self._layout, self._rows, self._movable = layout, rows, layout.movable

    def of(self, diagonal: Floats) -> Floats:
        """The diagonal of M, (..., movable) kg, with light blocks as heavy as what they carry.

        Blocks without mass are left without.
        """
        heaviest = diagonal.max(axis=-1, initial=0.0, keepdims=True)
        light = ((diagonal > 0.0) & (diagonal < _LIGHT * heaviest)).any(axis=-1)
        if not light.any():
            return diagonal
        found = diagonal.copy()
        each = found.reshape(-1, self._movable)
        for n in np.flatnonzero(light):
            self._carry(each[n])
        return found

    def _carry(self, masses: Floats) -> None:
        """Make light blocks as heavy as the second heaviest part that they join, in place."""
        weights = self._weights(masses)
        finite = weights[(weights > 0.0) & (weights < np.inf)]
        for level in np.unique(finite)[::-1]:
            light = (masses > 0.0) & (masses < _LIGHT * level)
            if not light.any():
                break
            for between in self._between(weights >= level):
                masses[between[light[between]]] = level

    def _weights(self, masses: Floats) -> Floats:
        """(parts,) the largest mass of each part among blocks that no other part has, if any; the
        ground is heavier than all."""
        count = np.bincount(np.concatenate(self._parts), minlength=self._movable + 1)
        known = np.append(masses, np.inf)
        alone = [part[count[part] == 1] for part in self._parts]
        return np.array(
            [
                known[own if own.size else part].max()
                for own, part in zip(alone, self._parts, strict=True)
            ]
        )

    def _between(self, heavy: NDArray[np.bool_]) -> Iterator[Integers]:
        """Blocks of lighter parts that join heavy parts, which no part joins otherwise."""
        parts = [part for part, is_heavy in zip(self._parts, heavy, strict=True) if is_heavy]
        lighter = np.ones(self._movable + 1, dtype=bool)
        lighter[np.concatenate(parts)] = False
        i, j = self._ties.T
        inside = lighter[i] & lighter[j]
        graph = sparse.coo_matrix(
            (inside[inside], (i[inside], j[inside])), shape=(lighter.size,) * 2
        )
        group = connected_components(graph, directed=False)[1]
        across = lighter[i] != lighter[j]
        at, to = np.where(lighter[i], (i, j), (j, i))[:, across]
        for label in np.unique(group[at]):
            touched = np.unique(to[group[at] == label])
            if not any(np.isin(touched, part).all() for part in parts):
                yield np.flatnonzero(group == label)

    @cached_property
    def _parts(self) -> list[Integers]:
        """The movable blocks of each body, each block of no body, and the ground, one block."""
        ground = self._movable
        bodies = [np.array(own) for own in self._layout.of_body.values()]
        parts = [own[own < ground] for own in bodies]
        free = np.setdiff1d(np.arange(ground), np.concatenate([[], *parts]))
        return [*(part for part in parts if part.size), *free[:, None], np.array([ground])]

    @cached_property
    def _ties(self) -> Integers:
        """(ties, 2) blocks that a body or a row binds; fixed blocks are the ground."""
        rows, ground = self._rows, self._movable
        own = [np.array(blocks) for blocks in self._layout.of_body.values()]
        forms = np.split(rows.block.astype(np.int64), rows.first[1:-1].astype(np.int64))
        cliques = [each for each in (*own, *forms) if each.size]
        stars = [np.stack([np.full_like(each, each[0]), each], 1) for each in cliques]
        bars = np.stack([rows.i, rows.j], 1).astype(np.int64)
        return np.minimum(np.concatenate([bars, *stars]), ground)

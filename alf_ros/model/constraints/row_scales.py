"""The scale of each row, its penalty α and how it bends, from the drawing."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Indices, Integers
from alf_ros.kernel import Rows, System
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.struct_memory import changed


def scaled_rows(
    system: System, q: Floats, layout: Layout, penalty: float, carried: Floats
) -> Rows:
    """The rows with scale 1 / |Φ_q,r|, α_r = penalty / (Φ_q,r M⁻¹ Φ_q,rᵀ) and bend, as drawn.

    carried (movable,): the diagonal of M, kg, with the masses that light blocks carry.
    """
    rows, D = system.rows, layout.dimension
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian((0.0,) * D, rows, q, g, g2)
    lengths = RowLengths(rows, g, g2, D)
    masses = lengths.masses(carried, system.mean, layout.blocks)
    scale = 1.0 / np.sqrt(lengths.squared)
    return changed(
        rows, alpha=penalty / masses, scale=scale, bend=scale * curvatures(rows, rows.term)
    )


def curvatures(rows: Rows, term: Floats) -> Floats:
    """(..., rows) |T|, the largest coefficient: 1 of distances, 0 of linear rows. term (...,
    terms D D): of one mechanism, or of several members with rows like these."""
    several, count = term.shape[:-1], rows.term_block.size
    found = np.zeros((*several, rows.alpha.size))
    found[..., : rows.i.size] = 1.0
    if count:
        largest = np.abs(term).reshape(*several, count, -1).max(axis=-1)
        start = rows.first_term[rows.first].astype(np.int64)  # of each row, and the end
        bent = np.flatnonzero(np.diff(start))
        found[..., rows.i.size + bent] = np.maximum.reduceat(largest, start[bent], axis=-1)
    return found


class RowLengths:
    """|Φ_q,r|² of rows as drawn, and of the parts of their blocks.

    g (..., distance rows D), g2 (..., entries D): Φ_q of one mechanism, or of several members with
    rows like these.
    """

    def __init__(self, rows: Rows, g: Floats, g2: Floats, D: int) -> None:
        self._rows, self._alike = rows, _of_one_length(rows.first, rows.movable)
        self._square, self._entry = (
            np.add.reduce(each.reshape(*each.shape[:-1], -1, D) ** 2, axis=-1) for each in (g, g2)
        )

    @property
    def squared(self) -> Floats:
        """(..., rows) |Φ_q,r|²; 1 of rows that bind fixed blocks only."""
        return self._sums(self._square, self._square, self._entry, 1.0)

    def masses(self, diagonal: Floats, mean: float | Floats, blocks: int) -> Floats:
        """(rows,) Φ_q,r M⁻¹ Φ_q,rᵀ: one over the mass that a row moves, about its lightest block.

        M is replaced by its `diagonal` (movable,), and missing masses by their `mean`, as in rows
        that bind fixed blocks only; of several mechanisms (members, movable) and (members,).
        blocks: how many there are, fixed ones too.
        """
        several, rows = diagonal.shape[:-1], self._rows
        light = np.zeros((*several, blocks))  # 1 / mass of each block; fixed ones do not move
        instead = mean[..., None] if isinstance(mean, np.ndarray) else mean
        light[..., : diagonal.shape[-1]] = 1.0 / np.where(diagonal > 0.0, diagonal, instead)
        i, j = self._square * light[..., rows.i], self._square * light[..., rows.j]
        return self._sums(i, j, self._entry * light[..., rows.block], 1.0 / instead)

    def _sums(self, i: Floats, j: Floats, entries: Floats, otherwise: float | Floats) -> Floats:
        """Σ |Φ_q,r,b|² over the movable blocks b of each row, of its parts; otherwise this."""
        rows = self._rows
        both, bars = int(rows.both), rows.i.size
        total = np.zeros((*i.shape[:-1], rows.alpha.size))
        total[..., :bars] = i
        total[..., :both] += j[..., :both]
        of_forms = total[..., bars:]
        for own, places in self._alike:
            # in the order of one mechanism, in which the sum of many numbers is rounded
            parts = np.ascontiguousarray(entries[..., places])
            of_forms[..., own] = np.add.reduce(parts, axis=-1)
        return np.where(total > 0.0, total, otherwise)


@remembered(64)
def _of_one_length(first: Indices, movable: Indices) -> list[tuple[Integers, Integers]]:
    """Rows that have as many movable entries (rows,), and their entries (rows, entries)."""
    start, count = first[:-1].astype(np.int64), (movable - first[:-1]).astype(np.int64)
    groups = ((np.flatnonzero(count == m), np.arange(m)) for m in np.unique(count).tolist())
    return [(own, start[own, None] + entries) for own, entries in groups]

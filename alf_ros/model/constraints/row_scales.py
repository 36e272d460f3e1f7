"""The scale of each row, and its penalty α, from the drawing."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats, Indices, Integers
from alf_ros.kernel import Rows, System
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.struct_memory import changed


def scaled_rows(system: System, q: Floats, layout: Layout, penalty: float) -> Rows:
    """The rows with scale 1 / |Φ_q,r| and α_r = penalty / (Φ_q,r M⁻¹ Φ_q,rᵀ), both as drawn.

    One over the denominator is the mass that the row moves: about its lightest block. M is
    replaced by its diagonal, and missing masses by the mean.
    """
    rows, D = system.rows, layout.dimension
    g, g2 = np.zeros(rows.i.size * D), np.zeros(rows.b.size)
    kernel.jacobian((0.0,) * D, rows, q, g, g2)
    light = np.zeros(layout.blocks)  # 1 / mass of each block; fixed ones do not move
    mass = system.mass.diagonal
    light[: mass.size] = 1.0 / np.where(mass > 0.0, mass, system.mean)
    square, entry = (np.add.reduce(each.reshape(-1, D) ** 2, axis=1) for each in (g, g2))
    both, bars, alike = int(rows.both), rows.i.size, _of_one_length(rows.first, rows.movable)

    def sums(i: Floats, j: Floats, entries: Floats) -> Floats:
        """Σ |Φ_q,r,b|² over the movable blocks b of each row, of its parts."""
        total = np.zeros(rows.alpha.size)
        total[:bars] = i
        total[:both] += j[:both]
        of_forms = total[bars:]
        for own, places in alike:
            of_forms[own] = np.add.reduce(entries[places], axis=1)
        total[~(total > 0.0)] = 1.0
        return total

    light_entries = entry * light[rows.block]
    masses = sums(square * light[rows.i], square * light[rows.j], light_entries)
    return changed(rows, alpha=penalty / masses, scale=1.0 / np.sqrt(sums(square, square, entry)))


@remembered(64)
def _of_one_length(first: Indices, movable: Indices) -> list[tuple[Integers, Integers]]:
    """Rows that have as many movable entries (rows,), and their entries (rows, entries)."""
    start, count = first[:-1].astype(np.int64), (movable - first[:-1]).astype(np.int64)
    groups = ((np.flatnonzero(count == m), np.arange(m)) for m in np.unique(count).tolist())
    return [(own, start[own, None] + entries) for own, entries in groups]

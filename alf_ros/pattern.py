"""The pattern of A = M + Φ_qᵀ α Φ_q and of its factor, analysed once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from alf_ros.kernel import Mass, Pattern, Rows
from alf_ros.layout import TURN, Layout
from alf_ros.mass import mass_of
from alf_ros.row import Row
from alf_ros.rows import indices


def elimination_order(layout: Layout, rows: Sequence[Row]) -> list[int]:
    """New place of every movable block: SuperLU's symmetric minimum degree order."""
    mass = mass_of(layout)
    graph = _neighbours(layout, zip(mass.i.tolist(), mass.j.tolist(), strict=True), rows)
    options = {'SymmetricMode': True}
    factor = splu(graph, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0, options=options)
    return [int(place) for place in factor.perm_c]


def _neighbours(layout: Layout, mass_pairs: Iterable[tuple[int, int]], rows: Sequence[Row]) -> Any:
    """Adjacency of the movable blocks in A, as a symmetric CSC matrix with a dominant diagonal."""
    i, j = [], []
    for pair in mass_pairs:
        i.append(pair[0])
        j.append(pair[1])
    for row in rows:
        blocks = [block for block in row.blocks if block < layout.movable]
        for n, block in enumerate(blocks):
            for other in blocks[:n]:
                i.append(block)
                j.append(other)
    n = layout.movable
    half = sparse.coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    whole = half + half.T
    whole.data[:] = -1.0
    return (whole + sparse.diags(np.asarray(-whole.sum(axis=1)).ravel() + 1.0)).tocsc()


def pattern_of(
    layout: Layout, mass: Mass, rows: Rows, cliques: Iterable[Sequence[int]] = ()
) -> Pattern:
    """Symbolic factorisation: the fill, and where the product of two blocks of a column goes.

    `cliques`: blocks that something else binds together.
    """
    D, n = layout.dimension, layout.movable
    below: list[set[int]] = [set() for _ in range(n)]
    both = int(rows.both)
    ends = [*zip(mass.i, mass.j, strict=True), *zip(rows.i[:both], rows.j[:both], strict=True)]
    for i, j in ends:
        below[min(i, j)].add(int(max(i, j)))
    entry_pairs = []
    for r in range(rows.movable.size):
        entries = range(rows.first[r], rows.movable[r])
        for e in entries:
            for f in entries:
                if rows.block[e] > rows.block[f]:
                    below[rows.block[f]].add(int(rows.block[e]))
                    entry_pairs.append((e, f, r))
    for clique in cliques:
        for block in clique:
            below[block].update(int(other) for other in clique if other > block)
    columns: list[list[int]] = []
    for k in range(n):  # a column's pattern goes on to its parent in the elimination tree
        column = sorted(below[k])
        columns.append(column)
        if column:
            below[column[0]].update(column[1:])
    first = np.concatenate([[0], np.cumsum([len(column) for column in columns])])
    place = {
        (i, k): first[k] + s for k, column in enumerate(columns) for s, i in enumerate(column)
    }
    target = [
        place[column[s], column[r]]
        for column in columns
        for s in range(len(column))
        for r in range(s)
    ]
    diagonal = np.zeros((n, D, D))
    off = np.zeros((int(first[-1]), D, D))
    diagonal[:] = mass.diagonal[:, None, None] * np.eye(D)
    for i, j, k in zip(mass.i, mass.j, mass.k, strict=True):
        off[place[i, j]] = k * np.eye(D)
    for s, w in zip(mass.skew, mass.w, strict=True):
        off[place[mass.i[s], mass.j[s]]] += w * TURN
    return Pattern(
        first=indices(first),
        row=indices(i for column in columns for i in column),
        target=indices(target),
        mass_diagonal=diagonal.ravel(),
        mass_off=off.ravel(),
        distance=indices(
            place[max(i, j), min(i, j)] for i, j in zip(rows.i[:both], rows.j[:both], strict=True)
        ),
        pair=np.array(
            [
                (e, f, place[rows.block[e], rows.block[f]], rows.i.size + r)
                for e, f, r in entry_pairs
            ],
            dtype=np.uint32,
        ).reshape(-1, 4),
    )

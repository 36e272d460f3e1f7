"""The pattern of A = M + Φ_qᵀ α Φ_q and of its factor, analysed once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from alf_ros.arrays import Floats, Indices, Integers
from alf_ros.kernel import Mass, Pattern, Rows
from alf_ros.kernel.numba_ext.jit import compiled
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import TURN, Layout
from alf_ros.model.constraints.packing import indices
from alf_ros.model.struct_memory import changed, frozen

_EYE = {D: np.eye(D) for D in (2, 3)}
_NO_PAIRS = np.zeros((0, 2), dtype=np.int64)


def elimination_order(mass: Mass, rows: Rows) -> Integers:
    """New place of every movable block: SuperLU's symmetric minimum degree order."""
    order: Integers = _ordered(mass.diagonal.size, *_structure(mass, rows))
    return order


def pattern_of(
    layout: Layout, mass: Mass, rows: Rows, cliques: Iterable[Sequence[int]] = ()
) -> Pattern:
    """Symbolic factorisation: the fill, and where the product of two blocks of a column goes.

    `cliques`: blocks that something else binds together.
    """
    fill = filled(layout.movable, mass, rows, cliques)
    masses = fill.masses_of(layout.dimension, mass.diagonal, mass.k, mass.skew, mass.w)
    return changed(fill.pattern, **masses)


def filled(n: int, mass: Mass, rows: Rows, cliques: Iterable[Sequence[int]] = ()) -> Filled:
    """`pattern_of`, without the numbers of M; n: movable blocks."""
    pairs = [(b, a) for clique in cliques for b in clique for a in clique if a < b]
    more = np.array(pairs, dtype=np.int64).reshape(-1, 2) if pairs else _NO_PAIRS
    fill: Filled = _filled(n, more, *_structure(mass, rows))
    return fill


class Filled(NamedTuple):
    """A pattern without masses, and the places of these: `masses` of the pairs of M, and `own` of
    the distances that bind the pairs `of_own` of M."""

    pattern: Pattern
    masses: Integers
    own: Integers
    of_own: Integers

    def masses_of(
        self, D: int, diagonal: Floats, k: Floats, skew: Indices, w: Floats
    ) -> dict[str, Floats]:
        """The numbers of M on the pattern, by the names of `Pattern`; diagonal, k, skew and w as
        in `Mass`, the numbers of one mechanism, or (members, ...) of several."""
        eye, several = _EYE[D], diagonal.shape[:-1]
        off = np.zeros((*several, self.pattern.row.size, D, D))
        off[..., self.masses, :, :] = k[..., None, None] * eye
        if skew.size:
            off[..., self.masses[skew], :, :] += w[..., None, None] * TURN
        bar = np.zeros((*several, self.pattern.distance.size))
        bar[..., self.own] = k[..., self.of_own]
        whole = diagonal[..., None, None] * eye
        shape = (*several, -1) if several else -1
        return {'mass_diagonal': whole.reshape(shape), 'mass_off': off.reshape(shape), 'bar': bar}


def _structure(mass: Mass, rows: Rows) -> tuple[Any, ...]:
    """Which blocks masses and rows bind: all that the pattern depends on."""
    bars = int(rows.both), rows.i, rows.j
    return mass.i, mass.j, *bars, rows.first, rows.movable, rows.block


@remembered(64)
def _ordered(
    n: int,
    mass_i: Indices,
    mass_j: Indices,
    both: int,
    bar_i: Indices,
    bar_j: Indices,
    first: Indices,
    movable: Indices,
    block: Indices,
) -> Integers:
    """The elimination order of a structure."""
    (i, j), pairs = _bound(mass_i, mass_j, bar_i[:both], bar_j[:both]), _pairs(first, movable)
    i = np.concatenate([i, block[pairs[:, 0]]])
    j = np.concatenate([j, block[pairs[:, 1]]])
    half = sparse.coo_matrix((np.ones(i.size), (i, j)), shape=(n, n)).tocsr()
    whole = half + half.T
    whole.data[:] = -1.0
    graph = (whole + sparse.diags(np.asarray(-whole.sum(axis=1)).ravel() + 1.0)).tocsc()
    options = {'SymmetricMode': True}
    factor = splu(graph, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0, options=options)
    return np.array(factor.perm_c, dtype=np.int64)


def _bound(
    mass_i: Indices, mass_j: Indices, bar_i: Indices, bar_j: Indices
) -> tuple[Integers, Integers]:
    """Pairs of blocks that a mass or a distance binds."""
    i = np.concatenate([mass_i, bar_i]).astype(np.int64)
    j = np.concatenate([mass_j, bar_j]).astype(np.int64)
    return np.maximum(i, j), np.minimum(i, j)


def _pairs(starts: Indices, movable: Indices) -> Integers:
    """(pairs, 3): two entries of movable blocks, the second before the first, and their row."""
    first, count = starts[:-1].astype(np.int64), movable - starts[:-1]
    found = []
    for m in range(2, int(count.max(initial=0)) + 1):
        own = np.flatnonzero(count == m)
        e, f = np.tril_indices(m, -1)
        row = np.repeat(own, e.size)
        at = first[row]
        found.append(np.stack([at + np.tile(e, own.size), at + np.tile(f, own.size), row], 1))
    pairs = np.concatenate([np.zeros((0, 3), dtype=np.int64), *found])
    return pairs[np.argsort(pairs[:, 2], kind='stable')]


@remembered(64)
def _filled(
    n: int,
    more: Integers,
    mass_i: Indices,
    mass_j: Indices,
    both: int,
    bar_i: Indices,
    bar_j: Indices,
    first_entry: Indices,
    movable: Indices,
    block: Indices,
) -> Filled:
    """Of a structure, and of `more` pairs of blocks."""
    i, j = _bound(mass_i, mass_j, bar_i[:both], bar_j[:both])
    e, f, row = _pairs(first_entry, movable).T
    bound = np.concatenate(
        [
            np.stack([i, j], axis=1),
            np.stack([block[e], block[f]], axis=1).astype(np.int64),
            more,
        ]
    )
    i_of_a, j_of_a = np.divmod(np.unique(bound[:, 0] * n + bound[:, 1]), n)
    first, below = _fill(np.searchsorted(i_of_a, np.arange(n + 1)), j_of_a)
    keys = np.repeat(np.arange(n), np.diff(first)) * n + below

    def place(i: Indices | Integers, j: Indices | Integers) -> Integers:
        """Where blocks below the diagonal stand."""
        return np.searchsorted(keys, j.astype(np.int64) * n + i)

    masses = mass_i.size
    of_mass = place(mass_i, mass_j)
    entries = place(block[e], block[f])
    bars, at = place(i[masses:], j[masses:]), np.full(below.size, -1)
    at[of_mass] = np.arange(masses)
    pair = at[bars]
    own = np.flatnonzero(pair >= 0)
    own = own[np.unique(pair[own], return_index=True)[1]]  # of rows that bind the same, one
    pattern = Pattern(
        first=indices(first),
        row=indices(below),
        target=indices(_targets(first, below)),
        mass_diagonal=np.zeros(0),
        mass_off=np.zeros(0),
        distance=indices(bars),
        bar=np.zeros(0),
        apart=indices(np.setdiff1d(np.arange(masses), pair[own])),
        pair=indices(np.stack([e, f, entries, bar_i.size + row], axis=1)),
    )
    return Filled(frozen(pattern), of_mass, own, pair[own])


@compiled
def _fill(start: Integers, column: Integers) -> tuple[Integers, Integers]:
    """The columns of L below the diagonal, by `first` and rows, ascending.

    `column` [`start` [i] .. `start` [i + 1]] are the columns of A in row i. Row i of L is the set
    reached from there on the elimination tree: Davis, Direct Methods for Sparse Linear Systems
    (2006), ch. 4.
    """
    n = start.size - 1
    parent, seen = np.full(n, -1), np.full(n, -1)
    first = np.zeros(n + 1, dtype=np.int64)
    for i in range(n):
        seen[i] = i
        for s in range(start[i], start[i + 1]):
            k = column[s]
            while seen[k] != i:
                if parent[k] < 0:
                    parent[k] = i
                seen[k] = i
                first[k + 1] += 1
                k = parent[k]
    for k in range(n):
        first[k + 1] += first[k]
    end, rows = first[:-1].copy(), np.zeros(first[n], dtype=np.int64)
    seen[:] = -1
    for i in range(n):
        seen[i] = i
        for s in range(start[i], start[i + 1]):
            k = column[s]
            while seen[k] != i:
                seen[k] = i
                rows[end[k]] = i
                end[k] += 1
                k = parent[k]
    return first, rows


@compiled
def _targets(first: Integers, row: Integers) -> Integers:
    """Where the product of two blocks of a column goes: by columns, first block, second block."""
    size = 0
    for k in range(first.size - 1):
        m = first[k + 1] - first[k]
        size += m * (m - 1) // 2
    target = np.zeros(size, dtype=np.int64)
    at = 0
    for k in range(first.size - 1):
        start, m = first[k], first[k + 1] - first[k]
        for r in range(m):  # the other entries here are part of the column of the r-th block
            place = first[row[start + r]]
            for s in range(r + 1, m):
                while row[place] != row[start + s]:
                    place += 1
                target[at + s * (s - 1) // 2 + r] = place
        at += m * (m - 1) // 2
    return target

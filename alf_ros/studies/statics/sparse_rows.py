"""M, Φ_q and its derivatives as sparse matrices, on the columns of all blocks; small ones as dense
arrays.

Rows are linear or quadratic in q, so that their Hessians H_k are constant, and so is the
derivative of N in a velocity row N(q) q̇. With J = [Φ_q; N]:

- `curvature`: L(λ) = ∂(Jᵀ λ)/∂q = Σ λ_k H_k, which is not symmetric for velocity rows;
- `turning`: R(v) = ∂(J v)/∂q, for constant v.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sparse

from alf_ros import kernel
from alf_ros.arrays import Floats, Integers
from alf_ros.kernel import Mass, Rows
from alf_ros.model.compile import Model

Sparse: TypeAlias = Any  # scipy.sparse.csr_matrix: scipy has no types


class Blocks(NamedTuple):
    """A matrix of `shape` of blocks `values` (count, a, b) in block rows i and block columns j;
    those at one place add up."""

    i: Integers
    j: Integers
    values: Floats
    shape: tuple[int, int]

    def sparse(self) -> Sparse:
        """As scipy keeps it."""
        _, a, b = self.values.shape
        # of other integers scipy would look for the largest, each time
        rows, columns = (np.arange(size, dtype=np.int32) for size in (a, b))
        row = (self.i.astype(np.int32) * np.int32(a))[:, None, None] + rows[None, :, None]
        column = (self.j.astype(np.int32) * np.int32(b))[:, None, None] + columns[None, None, :]
        places = [np.broadcast_to(each, self.values.shape).ravel() for each in (row, column)]
        return sparse.coo_matrix((self.values.ravel(), tuple(places)), self.shape).tocsr()

    def dense(self) -> Floats:
        """As an array."""
        _, a, b = self.values.shape
        rows, columns = self.shape
        row = (self.i.astype(np.int64) * a)[:, None, None] + np.arange(a)[None, :, None]
        column = (self.j.astype(np.int64) * b)[:, None, None] + np.arange(b)[None, None, :]
        at = (row * columns + column).ravel()
        found = np.bincount(at, self.values.ravel(), rows * columns)
        return np.asarray(found, dtype=float).reshape(self.shape)


def mass_matrix(model: Model) -> Sparse:
    """M (n, n), kg."""
    return mass_blocks(model).sparse()


def mass_blocks(model: Model) -> Blocks:
    """Of M (n, n), kg."""
    mass: Mass = model.system.mass
    D, blocks = model.layout.dimension, mass.diagonal.size
    eye = np.eye(D)
    off = mass.k[:, None, None] * eye
    if mass.skew.size:
        off[mass.skew] += mass.w[:, None, None] * np.array([[0.0, -1.0], [1.0, 0.0]])
    own = np.arange(blocks)
    i = np.concatenate([own, mass.i, mass.j])
    j = np.concatenate([own, mass.j, mass.i])
    values = np.concatenate([mass.diagonal[:, None, None] * eye, off, off.transpose(0, 2, 1)])
    return Blocks(i, j, values, (model.n, model.n))


def jacobian(model: Model, q: Floats) -> Sparse:
    """J = [Φ_q; N] (rows, blocks D) at q (blocks D, m), rows in the kernel's order."""
    return jacobian_blocks(model, q).sparse()


def jacobian_blocks(model: Model, q: Floats) -> Blocks:
    """Of J = [Φ_q; N]."""
    rows: Rows = model.system.rows
    D, m1 = model.layout.dimension, rows.i.size
    g, g2 = np.zeros(m1 * D), np.zeros(rows.b.size)
    kernel.jacobian(model.unit, rows, q, g, g2)
    d = g.reshape(-1, 1, D)
    own = np.arange(m1)
    i = np.concatenate([own, own, m1 + _owner(rows)])
    j = np.concatenate([rows.i, rows.j, rows.block])
    values = np.concatenate([d, -d, g2.reshape(-1, 1, D)])
    return Blocks(i, j, values, (rows.alpha.size, q.size))


def _owner(rows: Rows) -> Integers:
    """(entries,) the row, among those that are no distances."""
    first = rows.first.astype(np.int64)
    return np.repeat(np.arange(first.size - 1), np.diff(first))


def _terms(rows: Rows, D: int) -> tuple[Integers, Integers, Floats]:
    """(terms,) the entry of each term, its block, and T (terms, D, D)."""
    first = rows.first_term.astype(np.int64)
    entry = np.repeat(np.arange(first.size - 1), np.diff(first))
    return entry, rows.term_block.astype(np.int64), rows.term.reshape(-1, D, D)


def curvature(model: Model, lam: Floats, *, sizes: bool = False) -> Sparse:
    """L(λ) = ∂(Jᵀ λ)/∂q (blocks D, blocks D) of λ (rows,) in the kernel's order; `sizes`: how
    large the terms are that each entry is the sum of."""
    rows: Rows = model.system.rows
    D, m1 = model.layout.dimension, rows.i.size
    a, b = rows.i.astype(np.int64), rows.j.astype(np.int64)
    own = lam[:m1, None, None] * np.eye(D)
    entry, at, T = _terms(rows, D)
    of = lam[m1 + _owner(rows)][entry]
    i = np.concatenate([a, b, a, b, rows.block[entry].astype(np.int64)])
    j = np.concatenate([a, b, b, a, at])
    values = np.concatenate([own, own, -own, -own, of[:, None, None] * T])
    size = model.layout.blocks * D
    return Blocks(i, j, np.abs(values) if sizes else values, (size, size)).sparse()


def turning(model: Model, v: Floats) -> Sparse:
    """R(v) = ∂(J v)/∂q (rows, blocks D) of v (blocks D)."""
    return turning_blocks(model, v).sparse()


def turning_blocks(model: Model, v: Floats) -> Blocks:
    """Of R(v) = ∂(J v)/∂q."""
    rows: Rows = model.system.rows
    D, m1 = model.layout.dimension, rows.i.size
    blocks = v.reshape(-1, D)
    d = (blocks[rows.i] - blocks[rows.j])[:, None, :]
    entry, at, T = _terms(rows, D)
    along = np.einsum('sab,sa->sb', T, blocks[rows.block[entry]])[:, None, :]
    own = np.arange(m1)
    i = np.concatenate([own, own, m1 + _owner(rows)[entry]])
    j = np.concatenate([rows.i.astype(np.int64), rows.j.astype(np.int64), at])
    values = np.concatenate([d, -d, along])
    return Blocks(i, j, values, (rows.alpha.size, v.size))

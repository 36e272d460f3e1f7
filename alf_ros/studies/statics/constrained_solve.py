"""Solves of S x + Jᵀ y = f, J x = r with a sparse S, on the order-n factor of the step.

The matrix S + Jᵀ α J is factorised, so redundant rows need no treatment: they share y by least
norm. Rounds of the method of multipliers remove what α leaves of r and what rounding leaves of f.
The factor exists if and only if S is positive on the free directions, up to 1/α: so it also counts
as the test of stability.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.compile import Model, allocate
from alf_ros.model.symbolic_factor import pattern_of
from alf_ros.studies.statics.connected_parts import parts_of
from alf_ros.studies.statics.sparse_rows import Sparse

_FEWEST, _ROUNDS = 3, 40
_DONE = 1e-15  # part of x that the last round changes


class ConstrainedSolve:
    """A pattern that includes the blocks that effects bind, and one factor on it.

    parts: what the pattern connects.
    """

    def __init__(self, model: Model, cliques: Sequence[Sequence[int]]) -> None:
        self._model, movable = model, model.layout.movable
        bound = [sorted(b for b in clique if b < movable) for clique in cliques]
        system = model.system
        pattern = pattern_of(model.layout, system.mass, system.rows, bound)
        self._system = replace(system, pattern=pattern)
        self._work = allocate(model, self._system, 0)
        column = np.repeat(np.arange(movable), np.diff(pattern.first.astype(np.int64)))
        self._keys = column * movable + pattern.row
        self.parts = parts_of(
            column, pattern.row.astype(np.int64), movable, model.layout.dimension
        )
        heavy = system.mass.diagonal
        self._masses = np.where(heavy > 0.0, heavy, system.mean)
        self._alpha = system.rows.alpha
        self._S: Sparse = sparse.csr_matrix((model.n, model.n))
        self._J: Sparse = sparse.csr_matrix((self._alpha.size, model.n))
        self._transposed: Sparse = self._J.T

    def factorise(self, S: Sparse, J: Sparse, q: Floats) -> bool:
        """Factorise S (n, n), symmetric, N/m, with J (rows, n) at q (blocks D, m); returns whether
        S is positive on the directions that J leaves free."""
        model, D = self._model, self._model.layout.dimension
        self._S, self._J, self._transposed = S, J, J.T.tocsr()
        diagonal = np.abs(S.diagonal()).reshape(-1, D).max(axis=1)
        scale = float((diagonal / self._masses).max(initial=0.0)) or 1.0  # 1/s²
        self._alpha = model.system.rows.alpha * scale
        blocks = sparse.bsr_matrix(S, blocksize=(D, D))
        row = np.repeat(np.arange(model.layout.movable), np.diff(blocks.indptr))
        own, below = row == blocks.indices, row > blocks.indices
        on_diagonal = np.zeros((model.layout.movable, D, D))
        on_diagonal[row[own]] = blocks.data[own]
        off = np.zeros((self._keys.size, D, D))
        keys = blocks.indices[below].astype(np.int64) * model.layout.movable + row[below]
        off[np.searchsorted(self._keys, keys)] = blocks.data[below]
        system = replace(
            self._system,
            rows=replace(model.system.rows, alpha=self._alpha),
            pattern=replace(
                self._system.pattern, mass_diagonal=on_diagonal.ravel(), mass_off=off.ravel()
            ),
        )
        return bool(kernel.linearise(model.unit, system, self._work, q))

    def solve(self, f: Floats, r: Floats, done: float = _DONE) -> tuple[Floats, Floats]:
        """x (n,) and y (rows,) of f (n,) and r (rows,), with the last factor.

        done: the part of x that the last round may change; as far as rounding allows if absent.
        """
        S, J, transposed, alpha = self._S, self._J, self._transposed, self._alpha
        pattern, work = self._system.pattern, self._work
        x, y, gap = np.zeros(f.size), np.zeros(r.size), r
        d = f + transposed @ (alpha * r) if r.any() else np.array(f)
        before = np.inf
        for turn in range(_ROUNDS):
            kernel.solve(self._model.unit, pattern, work.diagonal, work.off, d)
            change = float(np.abs(d).max(initial=0.0))
            x += d
            y += alpha * (J @ d - gap)
            small = change <= done * float(np.abs(x).max(initial=0.0))
            # where x is nearly zero, the second round takes back what the first one made
            if small or (turn >= _FEWEST and change > 0.5 * before):
                break
            before, gap = change, r - J @ x
            d = f - S @ x + transposed @ (alpha * gap - y)
        return x, y

"""K = -∂Q/∂q and C = -∂Q/∂q̇ of all that acts, as sparse matrices.

Columns that share no row are displaced together, so that the number of evaluations does not grow
with the mechanism: Curtis, Powell & Reid, IMA J. Appl. Math. 13 (1974) 117.

The `tangent` of an effect is for a step that stays stable, and leaves negative parts out. Only the
blocks that it says an effect binds are read here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sparse

from alf_ros import effects as registry
from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import Effect, affine_force
from alf_ros.errors import InputError
from alf_ros.model.compile import Model
from alf_ros.studies.statics.force_change import RATES, STEPS, ForceChange
from alf_ros.studies.statics.sparse_rows import Blocks, Sparse

_WIDEST = 1500  # coordinates, up to which an effect may bind all blocks


class ForceTangents:
    """Which blocks effects bind, and in which turns they are displaced."""

    def __init__(self, model: Model, effects: Sequence[Effect]) -> None:
        """Raises InputError for an effect of a large mechanism that does not say what it binds."""
        self._model = model
        self.cliques = _cliques(model, effects)
        movable = model.layout.movable
        self._row, self._column = _pairs(self.cliques, movable)
        adjacency = sparse.coo_matrix(
            (np.ones(self._row.size), (self._row, self._column)), (movable, movable)
        ).tocsc()
        self._turn = _turns(adjacency)
        lengths = np.sqrt(model.system.rows.length2)
        self.length = float(np.median(lengths)) if lengths.size else model.size

    def stiffness(self, change: ForceChange) -> Sparse:
        """K (n, n), N/m."""
        steps = [step * self.length for step in STEPS]
        return self._columns(lambda along: change.of(along, np.zeros_like(along), steps))

    def damping(self, change: ForceChange) -> Sparse:
        """C (n, n), N s/m."""
        steps = [step * self.length for step in RATES]
        return self._columns(lambda along: change.of(np.zeros_like(along), along, steps))

    def _columns(self, change: Callable[[Floats], Floats]) -> Sparse:
        """-∂Q of displacements."""
        model, D = self._model, self._model.layout.dimension
        values = np.zeros((self._row.size, D, D))
        turn_of_pair = self._turn[self._column]
        for turn in range(int(self._turn.max(initial=-1)) + 1):
            pairs = np.flatnonzero(turn_of_pair == turn)
            blocks = np.flatnonzero(self._turn == turn)
            for axis in range(D):
                along = np.zeros(model.q.size)
                along[blocks * D + axis] = 1.0
                values[pairs, :, axis] = -change(along).reshape(-1, D)[self._row[pairs]]
        return Blocks(self._row, self._column, values, (model.n, model.n)).sparse()


def _cliques(model: Model, effects: Sequence[Effect]) -> list[tuple[int, ...]]:
    """The blocks that an effect binds, for each of the effects."""
    kinds: dict[str, list[Effect]] = {}
    for effect in effects:
        kinds.setdefault(effect.kind, []).append(effect)
    found: dict[tuple[int, ...], None] = {}
    for kind, instances in kinds.items():
        module = registry.load(kind)
        if getattr(module, 'CONSTANT', False):
            continue
        if module.force is affine_force.force:
            found.update(dict.fromkeys(_of_affine(module.pack(instances, model.layout).slots)))
        elif hasattr(module, 'tangent'):
            found.update(dict.fromkeys(module.pack(instances, model.layout).directions))
        elif model.n <= _WIDEST:
            found[tuple(range(model.layout.blocks))] = None
        else:
            raise InputError(
                f'an effect without tangent, in a mechanism of more than {_WIDEST} coordinates',
                key=f'effects.{kind}',
            )
    return list(found)


def _of_affine(slots: Integers) -> list[tuple[int, ...]]:
    """The pairs of blocks of the linear parts of an affine force."""
    constants, parts = int(slots[1]), int(slots[2])
    pairs = slots[3 + constants : 3 + constants + 2 * parts].reshape(-1, 2)
    return [tuple(pair) for pair in pairs.tolist()]


def _pairs(cliques: Sequence[Sequence[int]], movable: int) -> tuple[Integers, Integers]:
    """(pairs,) row and column of the movable blocks that effects bind, each pair once."""
    moving = ([block for block in clique if block < movable] for clique in cliques)
    pairs = {(i, j) for clique in moving for j in clique for i in clique}
    found = np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _turns(adjacency: sparse.csc_matrix) -> Integers:
    """(movable,) the turn in which a block is displaced; -1 if nothing binds it.

    Blocks of one turn share no row: greedy colouring.
    """
    columns = adjacency.shape[1]
    turns = np.full(columns, -1)
    start, row = adjacency.indptr, adjacency.indices
    taken: list[set[int]] = [set() for _ in range(adjacency.shape[0])]  # turns of each row
    for j in range(columns):
        own = row[start[j] : start[j + 1]].tolist()
        if own:
            used = set().union(*(taken[i] for i in own))
            turn = next(t for t in range(len(used) + 1) if t not in used)
            turns[j] = turn
            for i in own:
                taken[i].add(turn)
    return turns

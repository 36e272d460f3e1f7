"""K = -∂Q/∂q and C = -∂Q/∂q̇ of all that acts, as sparse matrices, to about 1e-12.

Differences of eighth order, with four lengths of the step. Of each entry the estimate counts
that differs least from the next finer one: a long step where the law is smooth, a short one beside
a kink. Columns that share no row are displaced together, so that the number of evaluations does
not grow with the mechanism: Curtis, Powell & Reid, IMA J. Appl. Math. 13 (1974) 117.

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
from alf_ros.studies.statics.sparse_rows import Sparse, of_blocks

_WEIGHTS = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)  # of the eighth order
_STEPS = (1e-2, 1e-3, 1e-4, 1e-5)  # of a typical length
_RATES = (1e-1, 1e-3, 1e-5, 1e-7)  # of a typical length a second: friction turns in 1e-3 m/s
_WIDEST = 1500  # coordinates, up to which an effect may bind all blocks
_ROUNDED = 4.0 * float(np.finfo(float).eps)

Force = Callable[[Floats, Floats], Floats]  # q, q̇ -> Q, all (blocks D,)


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

    def stiffness(self, force: Force, q: Floats, qd: Floats) -> Sparse:
        """K (n, n), N/m, at q, q̇ (blocks D, m, m/s)."""
        return self._differences(lambda d: force(q + d, qd), [s * self.length for s in _STEPS])

    def damping(self, force: Force, q: Floats, qd: Floats) -> Sparse:
        """C (n, n), N s/m."""
        return self._differences(lambda d: force(q, qd + d), [s * self.length for s in _RATES])

    def _differences(self, force: Callable[[Floats], Floats], steps: Sequence[float]) -> Sparse:
        """-∂Q of a displacement d."""
        model, D = self._model, self._model.layout.dimension
        values = np.zeros((self._row.size, D, D))
        turn_of_pair = self._turn[self._column]
        for turn in range(int(self._turn.max(initial=-1)) + 1):
            pairs = np.flatnonzero(turn_of_pair == turn)
            blocks = np.flatnonzero(self._turn == turn)
            row = self._row[pairs]
            for axis in range(D):
                along = np.zeros(model.q.size)
                along[blocks * D + axis] = 1.0
                found = [_slope(force, along, h) for h in steps]
                slopes = np.array([each.reshape(-1, D)[row] for each, _ in found])
                rounding = np.array([noise for _, noise in found])
                errors = np.abs(np.diff(slopes, axis=0)) + rounding[:-1, None, None]
                best = np.argmin(errors, axis=0)[None]
                values[pairs, :, axis] = -np.take_along_axis(slopes[:-1], best, 0)[0]
        return of_blocks(self._row, self._column, values, (model.n, model.n))


def _slope(force: Callable[[Floats], Floats], along: Floats, h: float) -> tuple[Floats, float]:
    """∂Q along a direction with a step h, and what rounding leaves of it."""
    slope, largest = np.zeros(along.size), 0.0
    for k, weight in enumerate(_WEIGHTS, 1):
        ahead, behind = force(k * h * along), force(-k * h * along)
        slope += (weight / h) * (ahead - behind)
        largest = max(largest, float(np.abs(ahead).max(initial=0.0)))
    return slope, _ROUNDED * largest / h


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

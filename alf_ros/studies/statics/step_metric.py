"""How far a descent steps: a metric, and the longest step.

In the metric of the mass, a step moves all masses alike where nothing resists. The links of a long
chain then turn one after another, and the number of steps grows with the number of links. The
metric of turning,

    |d|² = m Σ (l / a)² |d_i - d_j|² + ε dᵀ M d,   ε = (l / r)²,

counts the angle by which each link turns: i and j are two points of the link at the distance a,
or a unit vector of length a and what does not move; m is the mean mass, l a typical length. All
links turn at once. Translations of the reach r, the length of all links in a row, count as much as
turns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.studies.statics.sparse_rows import Sparse, mass_matrix

_LONGEST = 0.15  # of a step, in parts of a typical length: angles turn by less than a quarter
_TURN = 0.3  # rad that a link turns in a step
_NEAR = 1e-3  # of a typical length: of two points that are nearer, no angle is counted


@dataclass(frozen=True, eq=False)
class StepMetric:
    """matrix (n, n), kg. longest: of a step, m. turns (pairs D, n), 1/m: the angles (rad) by which
    a step turns each link, in components. cliques: the blocks of each pair."""

    matrix: Sparse
    longest: float
    turns: Sparse
    cliques: tuple[tuple[int, ...], ...]

    def allows(self, step: Floats) -> bool:
        """Whether a step (n,), m, is finite and not too long."""
        if not float(np.abs(step).max(initial=0.0)) <= self.longest:
            return False
        return float(np.abs(self.turns @ step).max(initial=0.0)) <= _TURN


def of_mass(model: Model, length: float) -> StepMetric:
    """M; `length`: a typical one, m."""
    return StepMetric(mass_matrix(model), _LONGEST * length, sparse.csr_matrix((0, model.n)), ())


def of_turning(model: Model, length: float) -> StepMetric:
    """The metric of turning, likewise."""
    layout, D = model.layout, model.layout.dimension
    row: list[int] = []
    column: list[int] = []
    entries: list[float] = []
    cliques: list[tuple[int, ...]] = []
    for body in model.mechanism.bodies:
        blocks, places = layout.of_body[body.name], layout.shape(body.name).local
        for n, (block, place) in enumerate(zip(blocks, places, strict=True)):
            is_point = n < len(body.points)
            distance = float(np.linalg.norm(place - places[0] if is_point else place))
            if distance <= _NEAR * length:
                continue
            ends = {block: 1.0 / distance}
            if is_point:
                ends[blocks[0]] = -1.0 / distance
            moving = {b: factor for b, factor in ends.items() if b < layout.movable}
            row += len(moving) * [len(cliques)]
            column += list(moving)
            entries += list(moving.values())
            cliques.append(tuple(moving))
    pairs = sparse.csr_matrix((entries, (row, column)), (len(cliques), layout.movable))
    turns = sparse.kron(pairs, sparse.identity(D)).tocsr()
    reach = reach_of(model, length)
    matrix = model.system.mean * length**2 * (turns.T @ turns)
    matrix = matrix + (length / reach) ** 2 * mass_matrix(model)
    return StepMetric(matrix.tocsr(), _LONGEST * reach, turns, tuple(cliques))


def reach_of(model: Model, length: float) -> float:
    """How far a mechanism may reach, m: as drawn, or with all links in a row."""
    return max(model.size, len(model.mechanism.bodies) * length)

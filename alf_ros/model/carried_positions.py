"""Positions of one model as positions of another model of the same bodies."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.compile import Model


def same_blocks(before: Layout, after: Layout) -> tuple[Integers, Integers]:
    """The blocks (shared,) of points, vectors and auxiliary vectors that both layouts have: their
    place after, and their place before."""
    to: list[int] = []
    of: list[int] = []
    for kind in ('of_point', 'of_vector', 'of_auxiliary'):
        own = getattr(before, kind)
        for name, block in getattr(after, kind).items():
            if name in own:
                to.append(block)
                of.append(own[name])
    return np.array(to, dtype=np.int64), np.array(of, dtype=np.int64)


def carried(before: Model, q: Floats, after: Model) -> Floats:
    """q (blocks D, m) of a model as q of another one; blocks that only that one has are as
    drawn."""
    found, D = np.array(after.q), before.layout.dimension
    to, of = same_blocks(before.layout, after.layout)
    found.reshape(-1, D)[to] = q.reshape(-1, D)[of]
    return found


def blocks_of(model: Model, values: Floats) -> Floats:
    """Numbers in the order of `Sample.q` (n,) as blocks D of the kernel, with vectors in their own
    length; 0 on blocks that do not move."""
    D, points = model.layout.dimension, sum(not point.fixed for point in model.mechanism.points)
    own = np.array(values, dtype=float).reshape(-1, D)
    own[points:] *= model.layout.length
    found = np.zeros((model.layout.blocks, D))
    found[model.coordinate_block] = own
    return found.ravel()

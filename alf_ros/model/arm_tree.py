"""Which block of a mechanism turns about which: a tree over blocks of the same body."""

from __future__ import annotations

from collections import defaultdict, deque

import numpy as np

from alf_ros.kernel import FREE, ORIGIN, Arms
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.struct_memory import frozen


def arms_of(layout: Layout) -> Arms:
    """Each point of a body turns about another of its points, vectors about themselves.

    The tree grows from the ground, by as few bodies as possible; a floating part hangs on one of
    its points, which turns about no other.
    """
    bodies = [(len(body.points), layout.of_body[body.name]) for body in layout.bodies]
    return _tree(tuple(bodies), layout.movable)


@remembered(64)
def _tree(bodies: tuple[tuple[int, tuple[int, ...]], ...], movable: int) -> Arms:
    """The tree of bodies with so many points, then vectors, on these blocks."""
    neighbours: dict[int, list[tuple[int, ...]]] = defaultdict(list)
    about = np.full(movable, FREE, dtype=np.int64)
    for count, blocks in bodies:
        points = blocks[:count]
        for block in points:
            neighbours[block].append(points)
        for block in blocks[count:]:
            if block < movable:
                about[block] = ORIGIN
    order: list[int] = []
    near = deque(block for block in neighbours if block >= movable)
    seen = set(near)
    floating = iter(list(neighbours))
    while True:
        while near:
            block = near.popleft()
            if block < movable:
                order.append(block)
            for points in neighbours[block]:
                for other in points:
                    if other not in seen:
                        seen.add(other)
                        near.append(other)
                        about[other] = block
        start = next((block for block in floating if block not in seen), None)
        if start is None:
            break
        seen.add(start)
        near.append(start)
    order += sorted(set(range(movable)) - set(order))
    return frozen(Arms(order=np.array(order, dtype=np.uint32), about=about))

"""Which block of a mechanism turns about which: a tree over blocks of the same body.
And, in space, which blocks tell how a body turns."""

from __future__ import annotations

from collections import defaultdict, deque
from typing import Any

import numpy as np

from alf_ros.arrays import Integers
from alf_ros.kernel import FREE, ORIGIN, Arms
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.struct_memory import frozen

Bodies = tuple[tuple[int, tuple[int, ...]], ...]  # points of each body, and its blocks


def arms_of(layout: Layout) -> Arms:
    """Each point of a body turns about another of its points, vectors about themselves.

    The tree grows from the ground, by as few bodies as possible; a floating part hangs on one of
    its points, which turns about no other.
    """
    bodies = [(len(body.points), layout.of_body[body.name]) for body in layout.bodies]
    return _tree(tuple(bodies), layout.movable, layout.dimension == 3)


@remembered(64)
def _tree(bodies: Bodies, movable: int, spatial: bool) -> Arms:
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
    sorted_out = np.array(order, dtype=np.uint32)
    return frozen(Arms(order=sorted_out, about=about, **_spokes(bodies, about, spatial)))


def _spokes(bodies: Bodies, about: Integers, spatial: bool) -> dict[str, Any]:
    """The points of each body from its first one on, and its vectors; of bodies with an arc."""
    first, found = [0], []
    for count, blocks in bodies if spatial else ():
        points, vectors = blocks[:count], blocks[count:]
        turning = {block for block in points if block < about.size and about[block] in points}
        movable = turning | {block for block in vectors if block < about.size}
        if not movable:
            continue
        hub = next((block for block in points if block not in turning), ORIGIN)
        found += [(block, hub, block in movable) for block in points if block != hub]
        found += [(block, ORIGIN, block in movable) for block in vectors]
        first.append(len(found))
    spoke, hubs, turns = zip(*found, strict=True) if found else ((), (), ())
    return {
        'first': np.array(first, dtype=np.uint32),
        'spoke': np.array(spoke, dtype=np.uint32),
        'hub': np.array(hubs, dtype=np.int64),
        'turns': np.array(turns, dtype=np.int64),
    }

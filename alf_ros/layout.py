"""Which block of the natural coordinates a point of a body is, and how forces on a body reach
blocks.

Two layouts of one mechanism are used. In the assembled one, bodies that meet at a point share its
block: the step integrates that. In the cut one every body owns its points: it tells what acts on
each body alone, hence the reactions in the joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Body, Mechanism


@dataclass(frozen=True)
class Layout:
    """Blocks of a mechanism: `movable` of them first, `blocks` in all.

    `of_point` gives the block of a point on its own (in the cut layout, that of the first body
    that carries it), `of_body` those of each body's points in the body's order.
    """

    mechanism: Mechanism
    movable: int
    blocks: int
    of_point: dict[str, int]
    of_body: dict[str, tuple[int, ...]]
    body: dict[str, Body]

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return self.mechanism.dimension

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, in the order of the file."""
        return self.mechanism.bodies

    def basis(self, body: str) -> tuple[int, int]:
        """Blocks of the two points that carry a body; the same twice if it has only one."""
        blocks = self.of_body[body]
        return blocks[0], blocks[min(1, len(blocks) - 1)]

    def coordinates(self, body: str, local: tuple[float, ...]) -> tuple[float, float]:
        """(a, b) of a place in the body frame (m): r = P_0 + a (P_1 - P_0) + b J (P_1 - P_0)."""
        shape = self.body[body].local
        if len(shape) == 1:
            return 0.0, 0.0
        return local[0] / shape[1][0], local[1] / shape[1][0]

    def carry(self, body: str, local: tuple[float, ...]) -> list[tuple[int, Floats]]:
        """(block, C) pairs: a force F at that place of the body adds C F (N) to the block."""
        i, j = self.basis(body)
        a, b = self.coordinates(body, local)
        one, turn = np.eye(2), np.array([[0.0, -1.0], [1.0, 0.0]])
        if i == j:
            return [(i, one)]
        return [(i, (1.0 - a) * one + b * turn), (j, a * one - b * turn)]

    def place(self, name: str, at: str | None = None) -> tuple[int, int, float, float]:
        """(i, j, a, b) of a body's centre of mass, of its point `at`, or (block, block, 0, 0) of
        a point.

        Raises ValueError if `at` is not a point of the body.
        """
        if name not in self.body:
            return self.of_point[name], self.of_point[name], 0.0, 0.0
        body = self.body[name]
        if at is None:
            local = body.com
        elif at in body.points:
            local = body.local[body.points.index(at)]
        else:
            raise ValueError(f'{at!r} is no point of {name!r}, which has {", ".join(body.points)}')
        return *self.basis(name), *self.coordinates(name, local)


def cut(mechanism: Mechanism) -> Layout:
    """The layout in which every body owns its points."""
    of_body: dict[str, tuple[int, ...]] = {}
    of_point: dict[str, int] = {}
    n = 0
    for body in mechanism.bodies:
        of_body[body.name] = tuple(range(n, n + len(body.points)))
        for name, block in zip(body.points, of_body[body.name], strict=True):
            of_point.setdefault(name, block)
        n += len(body.points)
    for point in mechanism.points:  # a point of no body: nothing of a body acts there
        if point.name not in of_point:
            of_point[point.name] = n
            n += 1
    return Layout(
        mechanism, n, n, of_point, of_body, {body.name: body for body in mechanism.bodies}
    )


def assembled(mechanism: Mechanism, order: dict[str, int]) -> Layout:
    """The layout in which points are shared; `order` is the block of every point."""
    of_body = {body.name: tuple(order[p] for p in body.points) for body in mechanism.bodies}
    movable = sum(not point.fixed for point in mechanism.points)
    bodies = {body.name: body for body in mechanism.bodies}
    return Layout(mechanism, movable, len(mechanism.points), order, of_body, bodies)

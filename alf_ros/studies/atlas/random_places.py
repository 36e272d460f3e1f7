"""Random places from which the loops of a mechanism are closed, to find all of its assemblies.

Three kinds take turns: noise on the drawing, which finds assemblies near it; a known position with
one or two points mirrored at a line or plane through other points, which flips a part over; and a
known position with one body turned about one of its points, in space about one of its axes or any.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model

_AMPLITUDES = (0.1, 0.3, 1.0)  # of the size: noise, in turn


class RandomPlaces:
    """Makes random places of a model, around a drawing (blocks D, m), from a seed."""

    def __init__(self, model: Model, drawn: Floats, seed: int) -> None:
        self._model, self._drawn = model, drawn
        self._random = np.random.default_rng(seed)
        layout = model.layout
        self._movable = [b for b in layout.of_point.values() if b < layout.movable]
        self._all = [*layout.of_point.values()]

    def place(self, n: int, known: Sequence[Floats]) -> Floats:
        """The n-th place (blocks D, m); `known`: positions found so far."""
        kind = n % 3 if known and self._movable else 0
        q = self._drawn if kind == 0 else known[int(self._random.integers(len(known)))]
        found = np.array(q)
        places = found.reshape(-1, self._model.layout.dimension)
        if kind == 0:
            away = _AMPLITUDES[(n // 3) % len(_AMPLITUDES)] * self._model.size
            found[: self._model.n] += away * self._random.standard_normal(self._model.n)
        elif kind == 1:
            self._flip(places)
        else:
            self._turn(places)
        # what is held or fixed stays where the drawing has it
        found[self._model.n :] = self._drawn[self._model.n :]
        return found

    def _flip(self, places: Floats) -> None:
        """Mirror one or two points."""
        random, D = self._random, self._model.layout.dimension
        count = min(len(self._movable), int(random.integers(1, 3)))
        for block in random.choice(self._movable, size=count, replace=False):
            at = places[random.choice(self._all)]
            normal = np.eye(D)[random.integers(D)]
            if random.integers(2):
                line = places[random.choice(self._all)] - at
                normal = random.standard_normal(D)
                size = float(line @ line)
                normal -= (normal @ line) / size * line if size > 0.0 else 0.0
            size = float(normal @ normal)
            if size > 0.0:
                places[block] -= 2.0 * (normal @ (places[block] - at)) / size * normal

    def _turn(self, places: Floats) -> None:
        """Turn a body about one of its points."""
        random, layout = self._random, self._model.layout
        body = self._model.mechanism.bodies[random.integers(len(self._model.mechanism.bodies))]
        blocks = [int(block) for block in layout.of_body[body.name]]
        points, vectors = blocks[: len(body.points)], blocks[len(body.points) :]
        fixed = [block for block in points if block >= layout.movable]
        at = np.array(places[fixed[0] if fixed else random.choice(points)])
        angle = float(random.uniform(-np.pi, np.pi))
        if layout.dimension == 2:
            c, s = np.cos(angle), np.sin(angle)
            R = np.array([[c, -s], [s, c]])
        else:
            axis = random.standard_normal(3)
            if vectors and random.integers(4):
                axis = places[random.choice(vectors)]
            R = _turned(axis / np.linalg.norm(axis), angle)
        for block in points:
            places[block] = at + R @ (places[block] - at)
        for block in vectors:
            places[block] = R @ places[block]


def _turned(axis: Floats, angle: float) -> Floats:
    """(3, 3) the rotation about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))

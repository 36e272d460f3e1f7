"""Random places from which the loops of a mechanism are closed, to find all of its assemblies.

Three kinds take turns: noise on the drawing, which finds assemblies near it; a known position with
one or two points mirrored, at a line through two others or a plane through three, or along an
axis, which flips a part over; and a known position with one body turned about a joint.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND
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
            others = np.array([places[random.choice(self._all)] for _ in range(D)])
            at = others[0]
            normal = np.eye(D)[random.integers(D)]
            if random.integers(3):  # through as many other points as there are dimensions
                normal = np.linalg.svd(others[1:] - at)[2][-1]
            size = float(normal @ normal)
            if size > 0.0:
                places[block] -= 2.0 * (normal @ (places[block] - at)) / size * normal

    def _turn(self, places: Floats) -> None:
        """Turn a body about a joint: in space about the axis of the joint, or any."""
        random, layout = self._random, self._model.layout
        joints = self._model.mechanism.joints
        if not joints:
            return
        joint = joints[random.integers(len(joints))]
        name = joint.child if joint.parent == GROUND or random.integers(2) else joint.parent
        blocks = [int(block) for block in layout.of_body[name]]
        points = len(layout.body[name].points)
        pivot = layout.of_point[joint.point] if joint.point else blocks[0]
        at, angle = np.array(places[pivot]), float(random.uniform(-np.pi, np.pi))
        if layout.dimension == 2:
            c, s = np.cos(angle), np.sin(angle)
            R = np.array([[c, -s], [s, c]])
        else:
            axis = random.standard_normal(3)
            axes = joint.frames[0].axes
            if len(axes) and random.integers(4):
                axis = layout.direction(joint.parent, axes[-1]).value(places)
            R = _turned(axis / np.linalg.norm(axis), angle)
        for block in blocks[:points]:
            places[block] = at + R @ (places[block] - at)
        for block in blocks[points:]:
            places[block] = R @ places[block]


def _turned(axis: Floats, angle: float) -> Floats:
    """(3, 3) the rotation about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))

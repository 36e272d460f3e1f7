"""Whether a position fulfils the constraint rows, but holds parts as no assembly does.

Lengths and products of the points and vectors of a body are the same in a mirror. Rows that keep
two axes parallel keep them antiparallel too: a slider turned round in its guide. Along a curve of
positions neither changes.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.mechanism.affine import Form
from alf_ros.model.compile import Model
from alf_ros.model.constraints.rows import joint_rows

_PARALLEL = 1.0 - 1e-9  # cosine of two axes that are parallel
_FLAT = 1e-6  # part of the product of lengths: volumes that are smaller tell nothing
_MOVED = 1e-9  # of the size: by less nothing can have been turned round
# The axes that a joint keeps parallel, by the ends of the names of its rows.
_KEPT = {'tilt_x': 2, 'turn': 0}


def check_hands(model: Model, q: Floats) -> None:
    """Raise AssemblyError if q (blocks D, m) holds a part as no assembly does."""
    if np.abs(q - model.q).max(initial=0.0) <= _MOVED * model.size:
        return
    fault = Handedness(model).fault(q)
    if fault:
        raise AssemblyError(
            f'the mechanism cannot be closed from there: {fault}',
            key='initial.positions',
            expected='positions nearer to the drawing, or more points and vectors of that body',
        )


class Handedness:
    """Knows of each body of a model D directions that span space, and of each joint the axes that
    it keeps parallel, as they are drawn."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._frames: list[tuple[str, list[tuple[int, int]], float]] = []
        drawn = model.q.reshape(-1, model.layout.dimension)
        for body in model.mechanism.bodies:
            frame = self._frame(body.name, len(body.points), drawn)
            if frame is not None:
                self._frames.append((body.name, *frame))
        layout = model.layout
        self._axes: list[tuple[str, Form, Form]] = []
        for joint in model.mechanism.joints:
            first, last = joint.frames
            rows = {row.name.removeprefix(f'{joint.name}_') for row in joint_rows(joint, layout)}
            for n in (n for end, n in _KEPT.items() if end in rows):
                a = layout.direction(joint.parent, first.axes[n])
                b = layout.direction(joint.child, last.axes[n])
                if _cosine(a, b, drawn) > 0.0:
                    self._axes.append((joint.name, a, b))

    def is_mirrored(self, q: Floats) -> bool:
        """Whether a body is mirrored, or turned round in a joint, at q (blocks D, m)."""
        return bool(self.fault(q))

    def fault(self, q: Floats) -> str:
        """The body that is mirrored, or the joint in which one is turned round, at q (blocks D,
        m), in words; empty if there is none."""
        places = q.reshape(-1, self._model.layout.dimension)
        for name, pairs, volume in self._frames:
            if _volume(places, pairs)[0] * volume < 0.0:
                return f'body {name} would be its mirror image'
        for name, a, b in self._axes:
            if _cosine(a, b, places) < -_PARALLEL:
                return f'a body would be turned round in joint {name}'
        return ''

    def _frame(
        self, body: str, points: int, drawn: Floats
    ) -> tuple[list[tuple[int, int]], float] | None:
        """Pairs of blocks, the difference of which is a direction (a vector has -1 for none), and
        their volume as drawn; None for a body that is no wider than a line or plane."""
        blocks = [int(block) for block in self._model.layout.of_body[body]]
        directions = [(block, blocks[0]) for block in blocks[1:points]]
        directions += [(block, -1) for block in blocks[points:]]
        for pairs in combinations(directions, self._model.layout.dimension):
            volume, size = _volume(drawn, list(pairs))
            if abs(volume) > _FLAT * size:
                return list(pairs), volume
        return None


def _cosine(a: Form, b: Form, places: Floats) -> float:
    one, other = a.value(places), b.value(places)
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size > 0.0 else 0.0


def _volume(places: Floats, pairs: list[tuple[int, int]]) -> tuple[float, float]:
    rows = np.array([places[a] - (places[b] if b >= 0 else 0.0) for a, b in pairs])
    return float(np.linalg.det(rows)), float(np.prod(np.linalg.norm(rows, axis=1)))

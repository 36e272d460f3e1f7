"""Random places from which the loops of a mechanism are closed, to find all of its assemblies.

Three kinds take turns:

- noise on the drawing or on a known position;
- a known position with one or two points mirrored, or all points of a body or of the mechanism, at
  a line through two others or a plane through three, or along an axis, which flips a part over. In
  space, half of these mirror a part at a plane through its two joints: its bodies go to the rigid
  places nearest to their images, so that the dyad of a spherical four-bar folds over;
- and, twice as often, a known position with one body, and those that slide on it, turned about a
  joint. In space, half of these turn a part about the line through its two joints, often by half a
  turn (`parts_between_joints`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import GROUND
from alf_ros.model.compile import Model
from alf_ros.studies.atlas.parts_between_joints import parts_between_joints

_NOISE, _FLIP, _TURN = range(3)
_TURNS = (_NOISE, _FLIP, _TURN, _TURN)  # kinds of places, in turn
KINDS = len(_TURNS)  # starts of a round
_PARALLEL = ('prismatic', 'weld')
_SHORT = 1e-9  # of the size: two joints at one place
_LOOSE = 1e-3  # weight of what no other body shares: a joint holds the rest
_AMPLITUDES = (0.1, 0.3, 1.0)  # of the size: noise


class RandomPlaces:
    """Makes random places of a model, around a drawing (blocks D, m), from a seed."""

    def __init__(self, model: Model, drawn: Floats, seed: int) -> None:
        self._model, self._drawn = model, drawn
        self._random = np.random.default_rng(seed)
        layout = model.layout
        self._movable = [b for b in layout.of_point.values() if b < layout.movable]
        self._all = [*layout.of_point.values()]
        # what is mirrored as one: all points that move, first, and those of each body
        self._parts = [self._movable, *map(self._points, layout.of_body)]
        # bodies that turn as one, by each of them
        self._turning = {name: _guided(model, name) for name in layout.of_body}
        self._between = parts_between_joints(model)
        # by block, how many bodies share it, the ground included
        self._sharers = Counter(int(block) for of in layout.of_body.values() for block in of)
        self._sharers.update(range(layout.movable, len(model.q) // layout.dimension))
        # parts with a joint of their own, which folds
        self._folding = [
            part
            for part in self._between
            if any(self._sharers[block] > 1 for block in (*part.points, *part.vectors))
        ]

    def place(self, n: int, known: Sequence[Floats]) -> Floats:
        """The n-th place (blocks D, m); `known`: positions found so far."""
        random = self._random
        kind = _TURNS[n % len(_TURNS)] if known and self._movable else _NOISE
        of_drawing = not known or (kind == _NOISE and random.integers(2))
        q = self._drawn if of_drawing else known[int(random.integers(len(known)))]
        found = np.array(q)
        places = found.reshape(-1, self._model.layout.dimension)
        if kind == _NOISE:
            away = random.choice(_AMPLITUDES) * self._model.size
            found[: self._model.n] += away * random.standard_normal(self._model.n)
        elif kind == _FLIP and self._folding and random.integers(2):
            self._fold(places)
        elif kind == _FLIP:
            self._flip(places)
        elif self._between and self._random.integers(2):
            self._turn_between(places)
        else:
            self._turn(places)
        # what is held or fixed stays where the drawing has it
        found[self._model.n :] = self._drawn[self._model.n :]
        return found

    def _points(self, body: str) -> list[int]:
        """Blocks of the points of a body that move."""
        return [b for b in self._model.layout.of_body[body] if b in self._movable]

    def _flip(self, places: Floats) -> None:
        """Mirror one or two points, the points of a body, or all that move, at once."""
        random = self._random
        count = int(random.integers(1, 4))
        if count > 2:
            part = 0 if random.integers(2) else random.integers(len(self._parts))
            self._mirror(places, self._parts[part])
            return
        count = min(len(self._movable), count)
        for block in random.choice(self._movable, size=count, replace=False):
            self._mirror(places, [block])

    def _mirror(self, places: Floats, blocks: Sequence[int]) -> None:
        """Mirror points at a line or plane through others, or along an axis."""
        random, D = self._random, self._model.layout.dimension
        among = [block for block in self._all if block not in blocks] or self._all
        others = np.array([places[random.choice(among)] for _ in range(D)])
        at = others[0]
        normal = np.eye(D)[random.integers(D)]
        if random.integers(3):  # through as many other points as there are dimensions
            normal = np.linalg.svd(others[1:] - at)[2][-1]
        size = float(normal @ normal)
        if size > 0.0:
            moved = places[blocks]
            places[blocks] = moved - 2.0 / size * np.outer((moved - at) @ normal, normal)

    def _turn(self, places: Floats) -> None:
        """Turn a body, with those it slides on, about a joint: in space about the axis of the
        joint, or any."""
        random, layout = self._random, self._model.layout
        joints = self._model.mechanism.joints
        if not joints:
            return
        joint = joints[random.integers(len(joints))]
        name = joint.child if joint.parent == GROUND or random.integers(2) else joint.parent
        blocks = {int(block) for of in self._turning[name] for block in layout.of_body[of]}
        points = blocks & {*layout.of_point.values()}
        pivot = layout.of_point[joint.point] if joint.point else int(layout.of_body[name][0])
        at, angle = np.array(places[pivot]), float(random.uniform(-np.pi, np.pi))
        if layout.dimension == 2:
            c, s = np.cos(angle), np.sin(angle)
            R = np.array([[c, -s], [s, c]])
        else:
            axis = random.standard_normal(3)
            axes = joint.frames[0].axes
            if len(axes) and random.integers(4):
                along = layout.direction(joint.parent, axes[-1]).value(places)
                if np.linalg.norm(along) > _SHORT:  # a rod has no direction across it
                    axis = along
            R = _turned(axis / np.linalg.norm(axis), angle)
        for block in points:
            places[block] = at + R @ (places[block] - at)
        for block in blocks - points:
            places[block] = R @ places[block]

    def _turn_between(self, places: Floats) -> None:
        """Turn a part about the line through its two joints, by half a turn or any angle."""
        random = self._random
        part = self._between[random.integers(len(self._between))]
        at, end = (form.value(places) for form in part.ends)
        axis = end - at
        size = float(np.linalg.norm(axis))
        if size <= _SHORT * self._model.size:
            axis = random.standard_normal(3)
            size = float(np.linalg.norm(axis))
        angle = np.pi if random.integers(2) else float(random.uniform(-np.pi, np.pi))
        R = _turned(axis / size, angle)
        for block in part.points:
            places[block] = at + R @ (places[block] - at)
        for block in part.vectors:
            places[block] = R @ places[block]

    def _fold(self, places: Floats) -> None:
        """Mirror a part at a plane through its two joints, along an axis or through a point."""
        random, layout = self._random, self._model.layout
        part = self._folding[random.integers(len(self._folding))]
        at, end = (form.value(places) for form in part.ends)
        among = [form.value(places) for form in part.axes]
        if not among or not random.integers(4):
            among = [places[random.choice(self._all)] - at]
        normal = np.cross(end - at, among[random.integers(len(among))])
        size = float(np.linalg.norm(normal))
        if size <= _SHORT * self._model.size**2:
            return
        mirror = np.eye(3) - 2.0 / size**2 * np.outer(normal, normal)
        own = {*part.points, *part.vectors}
        before = places.copy()
        for name in part.bodies:
            blocks = [int(block) for block in layout.of_body[name]]
            points = len(layout.body[name].points)
            was = before[blocks]
            images = was @ mirror
            images[:points] += at - at @ mirror
            weights = np.array([1.0 if self._sharers[block] > 1 else _LOOSE for block in blocks])
            moved = _rigid(was, images, points, weights)
            for block, place in zip(blocks, moved, strict=True):
                if block in own:
                    places[block] = place


def _guided(model: Model, body: str) -> list[str]:
    """A body with those that joints keep parallel to it, such as the cylinder of a piston; alone
    if one of them is the ground."""
    found = [body]
    for name in found:
        for joint in model.mechanism.joints:
            pair = joint.parent, joint.child
            if joint.kind in _PARALLEL and name in pair:
                other = pair[name == pair[0]]
                found += [other] * (other not in found)
    return [body] if GROUND in found else found


def _rigid(was: Floats, images: Floats, points: int, weights: Floats) -> Floats:
    """The places of a rigid body that are nearest to some images of them: the first `points` are
    points, the others directions."""
    a, b, of_points = was.copy(), images.copy(), weights[:points]
    there = np.average(b[:points], axis=0, weights=of_points)
    a[:points] -= np.average(a[:points], axis=0, weights=of_points)
    b[:points] -= there
    u, _, vt = np.linalg.svd((a.T * weights) @ b)
    u[:, -1] *= np.linalg.det(u @ vt)  # no mirror image
    found = a @ u @ vt
    found[:points] += there
    return np.asarray(found)


def _turned(axis: Floats, angle: float) -> Floats:
    """(3, 3) the rotation about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))

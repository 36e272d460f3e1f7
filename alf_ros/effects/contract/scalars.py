"""Scalars of the natural coordinates that effects act on: joint coordinates, distances, places.

Each is made of rows r = c + Σ b·q + ½ Σ qᵀ T q, as constraints are: a length is a row itself, an
angle atan2(y, x) of two, the distance of two places the norm of the D components of the gap. An
effort F on a scalar x is the generalised force Q = F ∂x/∂q, so that its power is F ẋ.

slots: [D, instances, (kind, near, less, first row, params of the effect) per instance,
(slots, params) of each row, rows: entries, (block, terms, term blocks …) …];
params: [rows: c, (b, T …) …; numbers of the effect for each instance].
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import Packed
from alf_ros.effects.contract.gap_vectors import push_distance, size, vector, vector_rate
from alf_ros.kernel.numba_ext.branch_notes import nearest_whole
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.jit import shared as shared
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.mechanism import GROUND, Numbers
from alf_ros.mechanism.affine import Form, constant
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.joint_coordinates import angle_rows, length_row
from alf_ros.model.constraints.row import Row, linear

LENGTH, ANGLE, DISTANCE, PLACE = 0, 1, 2, 3
_HEAD, _WORDS = 2, 5


def place(layout: Layout, name: str, at: str | Numbers | None = None) -> Form:
    """A point, or a place on a body: a point of it, a place in its frame (m), or its centre of
    mass. On the ground a place in the world.

    Raises ValueError for a point that is not of the body, and for a place on a point.
    """
    if not isinstance(at, tuple):
        if name == GROUND:
            raise ValueError('a place on the ground is its coordinates, or a fixed point')
        return layout.placed(name, at)
    if name == GROUND:
        return constant(at)
    if name not in layout.body:
        raise ValueError(f'{name!r} is a point: it has no place of its own')
    return layout.place(name, at)


class Measures:
    """Collects scalars and the numbers of an effect that go with each, and packs them."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._rows: list[Row] = []
        self._words: list[tuple[int, int, int, int]] = []
        self._numbers: list[Floats] = []

    def is_angle(self, name: str) -> bool:
        """Whether a joint coordinate is an angle. Raises ValueError if there is none so named."""
        known = self._layout.mechanism.coordinate
        if name not in known:
            message = f'{name!r} has no single free axis; joint coordinates: {", ".join(known)}'
            raise ValueError(message)
        return known[name].is_angle

    def add_coordinate(self, name: str) -> None:
        """A joint coordinate, an angle with its turns. Raises ValueError if there is none."""
        is_angle, coordinate = self.is_angle(name), self._layout.mechanism.coordinate[name]
        if is_angle:
            rows = angle_rows(coordinate, self._layout)
            self._add(ANGLE, rows, coordinate.place, coordinate.less)
        else:
            self._add(LENGTH, [length_row(coordinate.joint, self._layout)])

    def add_distance(self, start: Form, end: Form) -> None:
        """The distance of two places."""
        self._add(DISTANCE, self._components(end - start))

    def add_place(self, where: Form, arms: Sequence[Form]) -> None:
        """A place, and directions of its body: rows D n + a are components a of the n-th."""
        parts = [row for form in (where, *arms) for row in self._components(form)]
        self._add(PLACE, parts)

    def _components(self, form: Form) -> list[Row]:
        return [linear('', e, form) for e in np.eye(self._layout.dimension)]

    def _add(self, kind: int, parts: Sequence[Row], near: int = 0, less: int = -1) -> None:
        self._words.append((kind, near, less, len(self._rows)))
        self._rows += parts
        self._numbers.append(np.zeros(0))

    def drawn(self, n: int = -1) -> float:
        """The n-th scalar, as the mechanism is drawn."""
        layout = self._layout
        q: list[Any] = [np.zeros(layout.dimension) for _ in range(layout.blocks)]
        at = {point.name: np.array(point.at) for point in layout.mechanism.points}
        along = {v.name: layout.length * np.array(v.along) for v in layout.mechanism.vectors}
        for name, block in (*layout.of_point.items(), *layout.of_vector.items()):
            q[block] = at[name] if name in at else along[name]
        for body in layout.bodies:
            named = zip(layout.of_body[body.name], (*body.points, *body.vectors), strict=True)
            for block, name in named:
                q[block] = at[name] if name in at else along[name]
        kind, _, less, first = self._words[n]
        value = [_value(row, q) for row in self._rows[first:]]
        if kind == ANGLE:
            other = columns.each(math.atan2, *value[3:1:-1]) if less >= 0 else 0.0
            drawn: float = columns.each(math.atan2, value[1], value[0]) - other
        elif kind == LENGTH:
            drawn = value[0]
        else:
            gap = columns.array(value[: layout.dimension])
            drawn = columns.real(columns.norm(gap))
        return drawn

    def give(self, numbers: Iterable[float]) -> None:
        """The numbers of the effect that go with the scalar added last."""
        self._numbers[-1] = columns.array(list(numbers))

    def packed(self, directions: int = 1, intervals: bool = False, smooth: bool = False) -> Packed:
        """All of it, for the functions below; an effect yields in so many directions of each
        scalar. `intervals`: whether it has kinks that `interval` knows; `smooth`: whether it has
        no kinks that `side` tells."""
        at = _HEAD + _WORDS * len(self._words) + 2 * len(self._rows)
        table: list[int] = []
        slots: list[int] = []
        params: list[Floats] = [np.zeros(0)]
        size = 0
        for row in self._rows:
            table += (at + len(slots), size)
            parts = [np.array([row.c])]
            slots.append(len(row.blocks))
            for block in row.blocks:
                terms = row.terms.get(block, {})
                slots += (block, len(terms), *terms)
                parts += (row.b[block], *(T.ravel() for T in terms.values()))
            params += parts
            size += sum(part.size for part in parts)
        words: list[int] = []
        first_row = _HEAD + _WORDS * len(self._words)
        for (kind, near, less, first), numbers in zip(self._words, self._numbers, strict=True):
            words += (kind, near, less, first_row + 2 * first, size)
            size += numbers.size
        head = [self._layout.dimension, len(self._words)]
        whole = np.array([*head, *words, *table, *slots], dtype=np.int64)
        ends = [*(first for *_, first in self._words[1:]), len(self._rows)]
        moved: list[tuple[int, ...]] = []
        for (*_, first), end in zip(self._words, ends, strict=True):
            blocks = {block for row in self._rows[first:end] for block in row.blocks}
            moved += directions * [tuple(sorted(blocks))]
        known = len(self._words) if intervals else 0
        numbers = np.concatenate([*params, *self._numbers])
        return Packed(whole, numbers, tuple(moved), known, smooth=smooth)


def _value(row: Row, q: Sequence[Floats]) -> float:
    total = row.c
    for block, b in row.b.items():
        terms = row.terms.get(block, {}).items()
        turned = sum(columns.dot(T, q[other]) for other, T in terms)
        total += columns.real(columns.dot(b + 0.5 * turned, q[block]))
    return total


# ------------------------------------------------------------------------------------- compiled


@shared
def numbers_of(slots: Integers, n: int) -> int:
    """Where the numbers of the effect for instance n begin in params."""
    return slots[2 + 5 * n + 4]


@shared
def component(
    q: Floats, qd: Floats, slots: Integers, params: Floats, n: int, a: int
) -> tuple[float, float]:
    """Value and rate of row a of instance n."""
    D = slots[0]
    row = slots[2 + 5 * n + 3] + 2 * a
    i, j = slots[row], slots[row + 1]
    value, rate = params[j], 0.0
    entries = slots[i]
    i += 1
    j += 1
    for _ in each(0, entries):
        b, terms = slots[i] * D, slots[i + 1]
        for c in each(0, D):
            c = np.int64(c)
            half = full = params[j + c]
            for s in each(0, terms):
                s = np.int64(s)
                m, T = slots[i + 2 + s] * D, j + D + (s * D + c) * D
                for d in each(0, D):
                    d = np.int64(d)
                    half = plus_product(half, 0.5 * params[T + d], q[m + d])
                    full = plus_product(full, params[T + d], q[m + d])
            value = plus_product(value, half, q[b + c])
            rate = plus_product(rate, full, qd[b + c])
        i += 2 + terms
        j += D + terms * D * D
    return value, rate


@shared
def component_value(q: Floats, slots: Integers, params: Floats, n: int, a: int) -> float:
    """Value of row a of instance n."""
    D = slots[0]
    row = slots[2 + 5 * n + 3] + 2 * a
    i, j = slots[row], slots[row + 1]
    value = params[j]
    entries = slots[i]
    i += 1
    j += 1
    for _ in each(0, entries):
        b, terms = slots[i] * D, slots[i + 1]
        for c in each(0, D):
            c = np.int64(c)
            half = params[j + c]
            for s in each(0, terms):
                s = np.int64(s)
                m, T = slots[i + 2 + s] * D, j + D + (s * D + c) * D
                for d in each(0, D):
                    d = np.int64(d)
                    half = plus_product(half, 0.5 * params[T + d], q[m + d])
            value = plus_product(value, half, q[b + c])
        i += 2 + terms
        j += D + terms * D * D
    return value


@shared
def push_component(
    q: Floats, slots: Integers, params: Floats, n: int, a: int, F: float, Q: Floats
) -> None:
    """Q += F ∂r/∂q of row a of instance n."""
    D = slots[0]
    row = slots[2 + 5 * n + 3] + 2 * a
    i, j = slots[row], slots[row + 1] + 1
    entries = slots[i]
    i += 1
    for _ in each(0, entries):
        b, terms = slots[i] * D, slots[i + 1]
        for c in each(0, D):
            c = np.int64(c)
            full = params[j + c]
            for s in each(0, terms):
                s = np.int64(s)
                m, T = slots[i + 2 + s] * D, j + D + (s * D + c) * D
                for d in each(0, D):
                    d = np.int64(d)
                    full = plus_product(full, params[T + d], q[m + d])
            Q[b + c] = plus_product(Q[b + c], full, F)
        i += 2 + terms
        j += D + terms * D * D


@shared
def _angle(
    q: Floats,
    qd: Floats,
    near: float,
    slots: Integers,
    params: Floats,
    n: int,
    a: int,
) -> tuple[float, float]:
    """atan2(y, x) of rows a, a + 1, with the turns that bring it near, and its rate."""
    x, xd = component(q, qd, slots, params, n, a)
    y, yd = component(q, qd, slots, params, n, a + 1)
    angle = math.atan2(y, x)
    angle += 2.0 * math.pi * nearest_whole((near - angle) / (2.0 * math.pi))
    return angle, (x * yd - y * xd) / (x * x + y * y)


@shared
def _push_angle(
    q: Floats, slots: Integers, params: Floats, n: int, a: int, F: float, Q: Floats
) -> None:
    x = component_value(q, slots, params, n, a)
    y = component_value(q, slots, params, n, a + 1)
    square = x * x + y * y
    push_component(q, slots, params, n, a, -F * y / square, Q)
    push_component(q, slots, params, n, a + 1, F * x / square, Q)


@shared
def scalar(
    q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats, n: int
) -> tuple[float, float]:
    """x and ẋ of instance n: an angle (rad), a length or a distance (m)."""
    at = 2 + 5 * n
    kind, less = slots[at], slots[at + 2]
    if kind == LENGTH:
        return component(q, qd, slots, params, n, 0)
    if kind == ANGLE:
        x, rate = _angle(q, qd, near[slots[at + 1]], slots, params, n, 0)
        if less >= 0:
            other, other_rate = _angle(q, qd, near[less], slots, params, n, 2)
            x -= other
            rate -= other_rate
        return x, rate
    x, y, z = vector(q, slots, params, n)
    xd, yd, zd = vector_rate(qd, slots, params, n)
    distance = size(x, y, z)
    half_rate = x * xd + y * yd + z * zd
    return distance, half_rate / distance if distance > 0.0 else 0.0


@shared
def push(q: Floats, slots: Integers, params: Floats, n: int, F: float, Q: Floats) -> None:
    """Q += F ∂x/∂q of instance n: F is an effort on its scalar, N m or N.

    Where a distance is zero it has no direction, and nothing is added.
    """
    kind, less = slots[2 + 5 * n], slots[2 + 5 * n + 2]
    if kind == LENGTH:
        push_component(q, slots, params, n, 0, F, Q)
    elif kind == ANGLE:
        _push_angle(q, slots, params, n, 0, F, Q)
        if less >= 0:
            _push_angle(q, slots, params, n, 2, -F, Q)
    else:
        x, y, z = vector(q, slots, params, n)
        push_distance(slots, params, n, F, size(x, y, z), x, y, z, Q)

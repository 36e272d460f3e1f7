"""The block of each point or vector in the natural coordinates, and places and directions on a
body as functions of them.

Two layouts of one mechanism are used. In the assembled one, bodies that meet at a point or share a
vector share its block: the step integrates that. In the cut one every body owns its blocks: it
gives the forces on each body alone, and thus the reactions in the joints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats
from alf_ros.mechanism import affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.form_of_rows import RowForm, row_form
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.parts import GROUND, Body, Mechanism, Numbers

TURN = np.array([[0.0, -1.0], [1.0, 0.0]])  # J, a quarter turn
_EYE = np.eye(2)
_APART = 0.5  # sine from which on directions are well apart
_SHORT = 1e-290  # m, of a direction that rounding may turn


@dataclass(frozen=True, eq=False)
class Shape:
    """Affine forms of bodies of one shape: r = P_0 + Σ c_k d_k with c = `inverse` (k, D) times the
    local place.

    Blocks are counted on the body, points then vectors: `local` holds each in the body frame (D,),
    m, `ends` are the blocks that make d_k: P_k (then `is_point`) or a vector. A planar body has
    d_1 alone; d_2 = J d_1.
    """

    local: tuple[Floats, ...]
    points: int
    ends: tuple[int, ...]
    inverse: Floats
    whole: bool = False  # whether its rows keep entries that are zero

    @cached_property
    def is_point(self) -> tuple[bool, ...]:
        """Of each end."""
        return tuple(n < self.points for n in self.ends)

    @cached_property
    def of_columns(self) -> bool:
        """Whether it is of many members at once."""
        return any(map(columns.of_columns, (*self.local, self.inverse)))


@dataclass(frozen=True, eq=False)
class Layout:
    """Blocks of a mechanism: `movable` of them first, `blocks` in all.

    `of_point` and `of_vector` give the block of a point or vector on its own (in the cut layout,
    the first body that has it), `of_body` the blocks of each body: points, then vectors.
    `of_prescribed` are the blocks that move as functions of time, `of_auxiliary` those that belong
    to no body otherwise (`auxiliary`).
    """

    mechanism: Mechanism
    movable: int
    blocks: int
    of_point: Mapping[str, int]
    of_vector: Mapping[str, int]
    of_body: Mapping[str, tuple[int, ...]]
    of_auxiliary: Mapping[str, int]
    of_prescribed: Mapping[str, int]
    _shapes: dict[str, Shape] = field(default_factory=dict)
    asked: RowForm = RowForm()  # the form of its equations, as far as it is given

    def renumbered(self, place: Sequence[int]) -> Layout:
        """The same with other numbers for the blocks: `place` (blocks,) of each."""

        def moved(blocks: Mapping[str, int]) -> dict[str, int]:
            return {name: place[n] for name, n in blocks.items()}

        return replace(
            self,
            of_point=moved(self.of_point),
            of_vector=moved(self.of_vector),
            of_body={name: tuple(place[n] for n in own) for name, own in self.of_body.items()},
            of_auxiliary=moved(self.of_auxiliary),
            of_prescribed=moved(self.of_prescribed),
        )

    def like(self, mechanism: Mechanism) -> Layout:
        """The same blocks of another mechanism of the same structure."""
        same = mechanism.geometry is not None and mechanism.geometry == self.mechanism.geometry
        form = row_form()
        shapes = self._shapes if same and form == self.asked else {}
        return replace(self, mechanism=mechanism, _shapes=shapes, asked=form)

    @property
    def body(self) -> Mapping[str, Body]:
        """Bodies by name."""
        return self.mechanism.body

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return self.mechanism.dimension

    @cached_property
    def length(self) -> float:
        """Length of the blocks of unit vectors, m, as in the drawing, so that every natural
        coordinate is a length, and every mass one."""
        if self.asked.length is not None:
            return self.asked.length
        places = np.array([point.at for point in self.mechanism.points])
        return columns.extent(places) or self._radius or 1.0

    @property
    def _radius(self) -> float:
        """The largest radius of a wheel, m; 0 without any."""
        joints = (joint for joint in self.mechanism.joints if not joint.angles)
        return columns.largest(abs(r) for joint in joints for r in (joint.value, joint.of_parent))

    @property
    def form(self) -> RowForm:
        """The form of the equations, for mechanisms with other numbers."""
        ends = tuple((body.name, self.shape(body.name).ends) for body in self.bodies)
        return RowForm(self.length, self.asked.whole, ends)

    @cached_property
    def _ends(self) -> dict[str, tuple[int, ...]]:
        return dict(self.asked.ends)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, in the order of the file."""
        return self.mechanism.bodies

    def shape(self, name: str) -> Shape:
        """Affine forms of a body; the same object for all bodies of one shape."""
        if name not in self._shapes:
            body = self.mechanism.body[name]
            unit = self.length if body.axes else 1.0
            ends = self._ends.get(name)
            if ends and max(ends) >= len(body.local) + len(body.axes):
                ends = None  # it had a further axis, as a body whose points lie in a plane has
            self._shapes[name] = _shape(
                self.dimension, unit, body.local, body.axes, self.asked.whole, ends
            )
        return self._shapes[name]

    def direction(self, body: str, local: Numbers) -> Form:
        """A direction fixed in a body (or in the ground), from the body frame."""
        if body == GROUND:
            return affine.constant(local)
        return direction(self.shape(body), local).on(self.of_body[body])

    def vector(self, body: str, local: Numbers) -> Form:
        """A vector fixed in a body (or in the ground), from the body frame, that is an input, such
        as a force. As `direction`, but nothing is remembered: every command has other numbers."""
        if body == GROUND:
            return affine.constant(local)
        return vector(self.shape(body), local).on(self.of_body[body])

    def place(self, body: str, local: Numbers) -> Form:
        """A place fixed in a body (or in the ground), from the body frame (m)."""
        if body == GROUND:
            return affine.constant(local)
        return place(self.shape(body), local).on(self.of_body[body])

    def placed(self, name: str, at: str | None = None) -> Form:
        """The centre of mass of a body, its point `at`, or a point of the mechanism.

        Raises ValueError if `at` is not a point of the body.
        """
        if name not in self.body:
            return affine.of_block(self.of_point[name], self.dimension)
        body = self.body[name]
        if at is None:
            return self.place(name, body.com)
        if at in body.points:
            return self.place(name, body.local[body.points.index(at)])
        raise ValueError(f'{at!r} is no point of {name!r}, which has {", ".join(body.points)}')

    def turns(self, name: str) -> bool:
        """Whether it has an orientation: a torque and a frame of its own make sense."""
        if name not in self.body:
            return False
        return len(self.shape(name).ends) >= (1 if self.dimension == 2 else 3)


def vector(shape: Shape, local: Numbers) -> Form:
    """A vector fixed in a body, from its frame, in the body's own blocks."""
    c, D = columns.dot(shape.inverse, columns.array(local)), shape.inverse.shape[1]
    total = Form({}, np.zeros(D))
    for end, is_point, weight in zip(shape.ends, shape.is_point, c, strict=False):
        d = carrier(end, is_point, D)
        total = total + d.times(weight * _EYE + c[1] * TURN if D == 2 else weight)
    return total


@lru_cache(maxsize=1024)
def carrier(end: int, is_point: bool, dimension: int) -> Form:
    """A direction that carries bodies, in their own blocks: to a point, or a vector."""
    d = affine.of_block(end, dimension)
    return d - affine.of_block(0, dimension) if is_point else d


@remembered(1024)
def direction(shape: Shape, local: Numbers) -> Form:
    """A direction of the drawing: a `vector` that is asked for again and again."""
    return vector(shape, local)


@remembered(1024)
def place(shape: Shape, local: Numbers) -> Form:
    """A place fixed in a body, from its frame (m), in the body's own blocks. A point that carries
    the body is its block, exactly."""
    carrying = (n for n, is_point in zip(shape.ends, shape.is_point, strict=True) if is_point)
    for n in (0, *carrying):
        if tuple(shape.local[n].tolist()) == tuple(local):
            return affine.of_block(n, shape.inverse.shape[1])
    return affine.of_block(0, shape.inverse.shape[1]) + direction(shape, local)


@remembered(1024)
def _shape(
    dimension: int,
    length: float,
    local: tuple[Numbers, ...],
    axes: tuple[Numbers, ...],
    whole: bool,
    ends: tuple[int, ...] | None,
) -> Shape:
    """The shape of bodies whose points and vectors are there in their frame, the vectors of a
    length, m. `ends`: the ones that carry them, if this is known."""
    points = len(local)
    places = [columns.array(place) for place in local]
    places += [length * np.array(axis) for axis in axes]
    # the second point, then vectors, then further points: independent ones span the body
    order = [*range(1, min(2, points)), *range(points, len(places)), *range(2, points)]
    if ends is None:
        found = independent([places[n] for n in order], 1 if dimension == 2 else 3)
        ends = tuple(order[k] for k in found)
    directions = [places[n] for n in ends]
    if dimension == 2 and directions:
        directions.append(columns.dot(TURN, directions[0]))
    inverse: Floats = np.zeros((0, dimension))
    if directions:
        inverse = columns.pseudoinverse(np.array(directions).T)
    inverse.flags.writeable = False
    return Shape(tuple(places), points, ends, inverse, whole)


def independent(directions: Sequence[Floats], most: int, least: float = 1e-6) -> tuple[int, ...]:
    """Which of the directions to choose as a basis, `most` of them: the first one that is not
    zero, then the first that is well apart from those chosen, or else the one farthest apart.

    `least` is the sine below which a direction counts as dependent.
    """
    if len(directions) == 1 and most and _SHORT < columns.norm(directions[0]) < math.inf:
        return (0,)
    return _independent(np.array(directions), most, least) if directions else ()


@remembered(1024)
def _independent(directions: Floats, most: int, least: float) -> tuple[int, ...]:
    """The same of directions in rows."""
    chosen: list[int] = []
    axes: list[Floats] = []
    while len(chosen) < most:
        apart = []
        for d in directions:
            size = columns.norm(d)
            unit = d / size if size > 0.0 else d
            across = unit - sum((columns.dot(unit, a) * a for a in axes), 0.0 * d)
            apart.append(columns.real(columns.norm(across)))
        good = [k for k, sine in enumerate(apart) if sine > _APART]
        if not good and columns.largest(apart) < least:
            break
        best = good[0] if good else int(np.argmax(apart))
        d = directions[best] / columns.norm(directions[best])
        d = d - sum((columns.dot(d, a) * a for a in axes), 0.0 * d)
        chosen.append(best)
        axes.append(d / columns.norm(d))
    return tuple(chosen)


def cut(mechanism: Mechanism) -> Layout:
    """The layout in which every body owns its points and vectors."""
    of_body: dict[str, tuple[int, ...]] = {}
    of_point: dict[str, int] = {}
    of_vector: dict[str, int] = {}
    of_auxiliary: dict[str, int] = {}
    of_prescribed: dict[str, int] = {}
    n = 0
    for body in mechanism.bodies:
        points = tuple(range(n, n + len(body.points)))
        n += len(points)
        vectors = tuple(range(n, n + len(body.vectors)))
        n += len(vectors)
        of_body[body.name] = points + vectors
        for name, block in zip(body.points, points, strict=True):
            of_point.setdefault(name, block)
        for name, block in zip(body.vectors, vectors, strict=True):
            of_vector.setdefault(name, block)
    for names, places in ((mechanism.points, of_point), (mechanism.vectors, of_vector)):
        for item in names:  # of no body: no force of a body acts there
            if item.name not in places:
                places[item.name] = n
                n += 1
    for name in mechanism.auxiliary:
        of_auxiliary[name], n = n, n + 1
    for each in mechanism.prescribed:
        of_prescribed[each.name], n = n, n + 1
    found = Layout(mechanism, n, n, of_point, of_vector, of_body, of_auxiliary, of_prescribed)
    return replace(found, asked=row_form())


def assembled(
    mechanism: Mechanism,
    of_point: Mapping[str, int],
    of_vector: Mapping[str, int],
    of_auxiliary: Mapping[str, int],
) -> Layout:
    """The layout in which points and vectors are shared, at the blocks given."""
    of_body = {
        body.name: tuple(of_point[p] for p in body.points)
        + tuple(of_vector[v] for v in body.vectors)
        for body in mechanism.bodies
    }
    movable = sum(not item.fixed for item in mechanism.blocks) + len(of_auxiliary)
    first = len(of_point) + len(of_vector) + len(of_auxiliary)
    of_prescribed = {item.name: n for n, item in enumerate(mechanism.prescribed, first)}
    blocks = first + len(of_prescribed)
    found = Layout(
        mechanism, movable, blocks, of_point, of_vector, of_body, of_auxiliary, of_prescribed
    )
    return replace(found, asked=row_form())

"""The constraints of a mechanism, one row each: rigid bodies, joints, and rows of velocities.

A row is kept as what it is made of until it goes into the kernel's arrays (`rows_of`): a distance
of two blocks, or a quadratic form Σ ½ q_iᵀ T_ij q_j + Σ b_i·q_i + c. Rows that bind velocities
only (38) have N_i = Σ T_ij q_j + b_i.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from alf_ros import form, rolling
from alf_ros.arrays import Floats, Indices
from alf_ros.form import Form
from alf_ros.kernel import Rows
from alf_ros.layout import Layout
from alf_ros.mechanism import Body, Joint

Terms = dict[int, dict[int, Floats]]


@dataclass(frozen=True, eq=False)
class Row:
    """One constraint row. A distance row has `length` (m) and two blocks, `ends`."""

    name: str
    b: dict[int, Floats] = field(default_factory=dict)  # by block: (D,)
    terms: Terms = field(default_factory=dict)  # by block, block: (D, D)
    c: float = 0.0
    ends: tuple[int, int] = (0, 0)
    length: float | None = None
    velocity: bool = False

    @property
    def blocks(self) -> list[int]:
        """All blocks whose coordinates the row binds, ascending."""
        return sorted(self.ends) if self.length is not None else sorted(self.b)


# ------------------------------------------------------------------------------ kinds of rows


def distance(name: str, i: int, j: int, length: float) -> Row:
    """½(|q_i - q_j|² - length²) = 0."""
    return Row(name, ends=(min(i, j), max(i, j)), length=length)


def linear(name: str, along: Floats, f: Form, offset: float = 0.0) -> Row:
    """along · f = offset."""
    b = {block: C.T @ along for block, C in f.parts.items()}
    return Row(name, _kept(b), c=float(along @ f.constant) - offset)


def product(name: str, f: Form, g: Form, offset: float = 0.0) -> Row:
    """f · g = offset."""
    b: dict[int, Floats] = {}
    terms: Terms = {}
    for first, second in ((f, g), (g, f)):
        for i, C in first.parts.items():
            b[i] = b.get(i, 0.0) + C.T @ second.constant
            for j, G in second.parts.items():
                row = terms.setdefault(i, {})
                row[j] = row.get(j, 0.0) + C.T @ G
    terms = {i: {j: T for j, T in row.items() if np.any(T)} for i, row in terms.items()}
    b = {i: v for i, v in b.items() if np.any(v) or terms.get(i)}
    return Row(name, b, terms, float(f.constant @ g.constant) - offset)


def motion(name: str, *pairs: tuple[Form, Form]) -> Row:
    """Σ ġ-products of the pairs: Σ f(q) · d/dt g(q) = 0, a row of velocities."""
    b: dict[int, Floats] = {}
    terms: Terms = {}
    for f, g in pairs:
        for i, C in g.parts.items():
            b[i] = b.get(i, 0.0) + C.T @ f.constant
            for j, F in f.parts.items():
                row = terms.setdefault(i, {})
                row[j] = row.get(j, 0.0) + C.T @ F
    return Row(name, b, terms, velocity=True)


def _kept(b: dict[int, Floats]) -> dict[int, Floats]:
    return {block: value for block, value in b.items() if np.any(value)}


# ------------------------------------------------------------------------------ of a mechanism


def unit_rows(layout: Layout) -> Iterator[Row]:
    """½(|v|² - length²) = 0 for each vector that moves and carries a body."""
    carrying = {end for body in layout.bodies for end in layout.basis(body.name).ends}
    for vector in layout.mechanism.vectors:
        block = layout.of_vector[vector.name]
        if not vector.fixed and block in carrying:
            v = form.of_block(block, layout.dimension)
            yield _times(0.5, product(f'{vector.name}_unit', v, v, layout.length**2))


def _times(factor: float, row: Row) -> Row:
    """A multiple of a row; half of a square has the vector itself as gradient, as a distance."""
    return replace(
        row,
        b={i: factor * b for i, b in row.b.items()},
        terms={i: {j: factor * T for j, T in t.items()} for i, t in row.terms.items()},
        c=factor * row.c,
    )


def rigidity(body: Body, layout: Layout) -> Iterator[Row]:
    """Lengths and angles of the basis of a body; every further point and vector from it.

    A row between fixed blocks binds nothing that moves, but it is there: a body on two fixed
    points has one constraint too many, and a reaction along the line between them that is open.
    """
    D, basis, blocks = layout.dimension, layout.basis(body.name), layout.of_body[body.name]
    named = dict(zip(blocks, (*body.points, *body.vectors), strict=True))
    local = {block: layout.local(body, n) for n, block in enumerate(blocks)}

    before: list[tuple[int, Form]] = []
    for n, (end, is_point) in enumerate(zip(basis.ends, basis.is_point, strict=True)):
        d = form.of_block(end, D)
        if is_point:
            d = d - form.of_block(basis.first, D)
            name = f'{body.name}_length' if n == 0 else f'{body.name}_{named[end]}_length'
            length = float(np.linalg.norm(local[end]))
            if min(basis.first, end) < layout.movable:
                yield distance(name, basis.first, end, length)
            else:
                yield _times(0.5 / length, product(name, d, d, length**2))  # so it is in m
        for other, e in before:
            name = f'{body.name}_{named[other]}_{named[end]}'
            yield product(name, e, d, float(local[end] @ local[other]))
        before.append((end, d))
    for block, name in named.items():  # what does not carry follows
        if block in (basis.first, *basis.ends):
            continue
        gap = form.of_block(block, D) - layout.direction(body.name, tuple(local[block]))
        if name in body.points:
            gap = gap - form.of_block(basis.first, D)
        for axis, along in zip('xyz', np.eye(D), strict=False):
            yield linear(f'{body.name}_{name}_{axis}', along, gap)


def joint_rows(joint: Joint, layout: Layout) -> list[Row]:
    """What a joint adds to what its bodies share: nothing for a planar revolute."""
    if joint.point is not None and joint.kind == 'revolute' and layout.dimension == 2:
        return []  # most joints of a large mechanism: no forms for nothing
    base, tip = joint.frames
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)

    def axis(which: int, n: int) -> Form:
        body, frame = ((joint.parent, base), (joint.child, tip))[which]
        return layout.direction(body, frame.axes[n])

    rows: list[Row] = []

    def add(suffix: str, f: Form, g: Form, offset: float = 0.0) -> None:
        name = f'{joint.name}_{suffix}' if suffix else joint.name
        rows.append(product(name, f, g, offset))

    def coincide() -> None:
        if joint.point is None:
            for name, e in zip('xyz', np.eye(layout.dimension), strict=False):
                rows.append(linear(f'{joint.name}_{name}', e, gap))

    def parallel() -> None:  # the z axes of parent and child
        if joint.vector is None:
            add('tilt_x', axis(0, 0), axis(1, 2))
            add('tilt_y', axis(0, 1), axis(1, 2))

    kind = joint.kind
    if layout.dimension == 2:
        if kind in ('revolute', 'weld'):
            coincide()
        if kind in ('slider', 'prismatic'):
            add('' if kind == 'slider' else 'side', axis(0, 1), gap)
        if kind in ('prismatic', 'weld'):
            add('turn', axis(0, 1), axis(1, 0))
        if kind == 'blade':
            rows.append(motion(joint.name, (axis(1, 1), layout.place(joint.child, tip.origin))))
        if kind == 'no_slip':
            add('touch', axis(0, 1), gap, joint.value)
        if kind in ('no_slip', 'rack'):
            rows.append(motion(joint.name, *rolling.on_a_line(joint, layout)))
        if kind == 'gear':
            rows.append(motion(joint.name, *rolling.of_gears(joint, layout)))
        return rows
    if kind in ('spherical', 'revolute', 'universal', 'weld'):
        coincide()
    if kind in ('cylindrical', 'prismatic'):
        add('side_x', axis(0, 0), gap)
        add('side_y', axis(0, 1), gap)
    if kind in ('revolute', 'cylindrical', 'prismatic', 'weld', 'planar'):
        parallel()
    if kind in ('prismatic', 'weld'):
        add('turn', axis(0, 0), axis(1, 1))
    if kind == 'universal':
        add('cross', axis(0, 2), axis(1, 0))
    if kind == 'perpendicular':
        add('', axis(0, 2), axis(1, 2))
    if kind in ('planar', 'no_slip'):
        add('touch', axis(0, 2), gap, joint.value)
    if kind == 'no_slip':
        for name, pairs in rolling.on_a_plane(joint, layout):
            rows.append(motion(f'{joint.name}_{name}', *pairs))
    if kind == 'distance':
        rows.append(_times(0.5, product(joint.name, gap, gap, joint.value**2)))
    return rows


# ------------------------------------------------------------------------------------- arrays


def rows_of(rows: Sequence[Row], layout: Layout) -> tuple[Rows, list[int]]:
    """The rows as the kernel wants them, and which row stands at each of its places."""
    D = layout.dimension
    held = [n for n, row in enumerate(rows) if row.length is not None]
    both = [n for n in held if rows[n].ends[1] < layout.movable]
    held = [n for n in held if rows[n].ends[1] >= layout.movable]
    place = [n for n, row in enumerate(rows) if row.length is None and not row.velocity]
    velocity = [n for n, row in enumerate(rows) if row.velocity]
    first, movable, block, b = [0], [], [], []
    first_term, term_block, term = [0], [], []
    for n in place + velocity:
        row = rows[n]
        for i in row.blocks:  # ascending, so that fixed blocks come last
            block.append(i)
            b.append(row.b[i])
            for j, T in row.terms.get(i, {}).items():
                term_block.append(j)
                term.append(T)
            first_term.append(len(term))
        movable.append(first[-1] + sum(i < layout.movable for i in row.blocks))
        first.append(len(block))
    ends = [rows[n].ends for n in both + held]
    order = both + held + place + velocity
    arrays = Rows(
        both=np.uint64(len(both)),
        i=indices(i for i, _ in ends),
        j=indices(j for _, j in ends),
        length2=np.array([rows[n].length for n in both + held], dtype=float) ** 2,
        first=indices(first),
        movable=indices(movable),
        block=indices(block),
        b=np.array(b, dtype=float).ravel(),
        first_term=indices(first_term),
        term_block=indices(term_block),
        term=np.array(term, dtype=float).reshape(-1, D * D).ravel(),
        c=np.array([rows[n].c for n in place], dtype=float),
        B=np.zeros(len(velocity)),
        alpha=np.zeros(len(order)),
        scale=np.zeros(len(order)),
    )
    return arrays, order


def indices(values: Iterable[Any]) -> Indices:
    """Unsigned integers, as the kernel has them."""
    return np.fromiter((int(value) for value in values), dtype=np.uint32)

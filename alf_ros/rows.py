"""The constraints of a mechanism, one row each: rigid bodies, joints, and rows of velocities.

A row is kept as what it is made of (`row`) until it goes into the kernel's arrays (`rows_of`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from alf_ros import auxiliary, form, rolling
from alf_ros.arrays import Indices
from alf_ros.disk import disk_rows
from alf_ros.form import Form
from alf_ros.kernel import Rows
from alf_ros.layout import Layout
from alf_ros.mechanism import Body, Joint
from alf_ros.row import Row, distance, linear, motion, product, scaled


def unit_rows(layout: Layout) -> Iterator[Row]:
    """½(|v|² - length²) = 0 for each vector that moves and carries a body."""
    carrying = {end for body in layout.bodies for end in layout.basis(body.name).ends}
    for vector in layout.mechanism.vectors:
        block = layout.of_vector[vector.name]
        if not vector.fixed and block in carrying:
            v = form.of_block(block, layout.dimension)
            yield scaled(0.5, product(f'{vector.name}_unit', v, v, layout.length**2))


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
                yield scaled(0.5 / length, product(name, d, d, length**2))  # so it is in m
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
            across = axis(1, 1)
            if joint.motion:
                across, turning = auxiliary.turned(joint.name, axis(1, 0), across, layout)
                rows += turning
            rows.append(motion(joint.name, (across, layout.place(joint.child, tip.origin))))
        if kind == 'no_slip':
            add('touch', axis(0, 1), gap, joint.value)
        if kind in ('no_slip', 'rack'):
            rows.append(rolling.on_a_line(joint, layout))
        if kind == 'rolling':
            apart = joint.of_parent + joint.value
            touch = product(f'{joint.name}_touch', gap, gap, apart**2)
            rows.append(scaled(0.5 / abs(apart), touch))  # so it is in m
        if kind in ('gear', 'rolling'):
            rows.append(rolling.of_gears(joint, layout))
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
        rows += rolling.on_a_plane(joint, layout)
    if kind == 'disk':
        rows += disk_rows(joint, layout)
    if kind == 'distance':
        rows.append(scaled(0.5, product(joint.name, gap, gap, joint.value**2)))
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
        alpha=np.zeros(len(order)),
        scale=np.zeros(len(order)),
    )
    return arrays, order


def indices(values: Iterable[Any]) -> Indices:
    """Unsigned integers, as the kernel has them."""
    return np.fromiter((int(value) for value in values), dtype=np.uint32)

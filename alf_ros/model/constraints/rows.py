"""The constraints of a mechanism, one row each: rigid bodies, joints, and rows of velocities.

A row is kept as what it is made of (`row`) until it goes into the kernel's arrays (`row_arrays`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from alf_ros import columns
from alf_ros.mechanism import Body, Joint, affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.form_of_rows import row_form
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout, Shape, carrier, direction
from alf_ros.model.constraints.row import (
    Constraint,
    Distance,
    Row,
    linear,
    product,
    scaled,
)
from alf_ros.model.joints import type_of
from alf_ros.model.joints.contract import Frames

_ROUNDED = 1e-12  # part of a coefficient that is rounding


def unit_rows(layout: Layout) -> Iterator[Row]:
    """½(|v|² - length²) = 0 for each vector that moves and carries a body."""
    carrying = {
        layout.of_body[body.name][end]
        for body in (layout.bodies if layout.mechanism.vectors else ())
        for end in layout.shape(body.name).ends
    }
    for vector in layout.mechanism.vectors:
        block = layout.of_vector[vector.name]
        if not vector.fixed and block in carrying:
            v = affine.of_block(block, layout.dimension)
            yield scaled(0.5, product(f'{vector.name}_unit', v, v, layout.length**2))


def rigidity(body: Body, layout: Layout) -> Iterator[Constraint]:
    """Lengths and angles of the affine form of a body; every further point and vector from it.

    A row between fixed blocks exists although it constrains no motion: a body on two fixed points
    has one constraint too many, and a reaction along the line between them that is open.
    """
    blocks, items = layout.of_body[body.name], (*body.points, *body.vectors)
    for row in _rigid(layout.shape(body.name)):
        own = row.on(blocks, f'{body.name}_{row.name.format(*items)}')
        if isinstance(own, Distance) and layout.movable <= min(own.start, own.end):
            D, length = layout.dimension, own.length
            d = affine.of_block(own.end, D) - affine.of_block(own.start, D)
            own = scaled(0.5 / length, product(own.name, d, d, length**2))  # so it is in m
        yield _held(own, layout.movable) if isinstance(own, Row) else own


def _held(row: Row, movable: int) -> Row:
    """The row, without parts of movable blocks that are rounding of the parts of fixed blocks: a
    third point on a line of fixed points would be held by such a part alone."""
    if row.terms or min(row.b, default=0) >= movable or max(row.b, default=0) < movable:
        return row
    most = columns.largest(abs(x) for b in row.b.values() for x in b)
    moves = columns.largest(abs(x) for block, b in row.b.items() if block < movable for x in b)
    if moves > _ROUNDED * most:
        return row
    if row_form().whole:
        held = {block: b if block >= movable else 0.0 * b for block, b in row.b.items()}
    else:
        held = {block: b for block, b in row.b.items() if block >= movable}
    return replace(row, b=held)


@remembered(1024)
def _rigid(shape: Shape) -> tuple[Constraint, ...]:
    """The rows of every body of a shape, on its own blocks, of which {n} in a name is the n-th."""
    D, local = shape.inverse.shape[1], shape.local
    found: list[Constraint] = []
    before: list[tuple[int, Form]] = []
    for n, (end, is_point) in enumerate(zip(shape.ends, shape.is_point, strict=True)):
        d = carrier(end, is_point, D)
        if is_point:
            name = 'length' if n == 0 else f'{{{end}}}_length'
            found.append(Distance(name, 0, end, columns.real(columns.norm(local[end]))))
        for other, e in before:
            name = f'{{{other}}}_{{{end}}}'
            found.append(product(name, e, d, columns.real(columns.dot(local[end], local[other]))))
        before.append((end, d))
    for n, place in enumerate(local):  # what does not carry follows
        if n in (0, *shape.ends):
            continue
        gap = affine.of_block(n, D) - direction(shape, tuple(place))
        if n < shape.points:
            gap = gap - affine.of_block(0, D)
        for axis, along in zip('xyz', np.eye(D), strict=False):
            found.append(linear(f'{{{n}}}_{axis}', along, gap))
    return tuple(found)


def joint_rows(joint: Joint, layout: Layout) -> list[Row]:
    """Rows that a joint adds to shared points and vectors: none for a planar revolute."""
    rows = type_of(joint).rows(Frames(joint, layout))
    return [_held(row, layout.movable) for row in rows]

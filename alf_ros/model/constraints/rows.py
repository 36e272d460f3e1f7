"""The constraints of a mechanism, one row each: rigid bodies, joints, and rows of velocities.

A row is kept as what it is made of (`row`) until it goes into the kernel's arrays (`row_arrays`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from alf_ros.mechanism import Body, Joint, affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout, Shape, direction
from alf_ros.model.constraints import auxiliary, rolling
from alf_ros.model.constraints.leaning_disk import disk_rows
from alf_ros.model.constraints.row import (
    Constraint,
    Distance,
    Row,
    linear,
    motion,
    product,
    scaled,
)


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
    """Lengths and angles of what carries a body; every further point and vector from it.

    A row between fixed blocks binds nothing that moves, but it is there: a body on two fixed
    points has one constraint too many, and a reaction along the line between them that is open.
    """
    blocks, items = layout.of_body[body.name], (*body.points, *body.vectors)
    for row in _rigid(layout.shape(body.name)):
        own = row.on(blocks, f'{body.name}_{row.name.format(*items)}')
        if isinstance(own, Distance) and layout.movable <= min(own.start, own.end):
            D, length = layout.dimension, own.length
            d = affine.of_block(own.end, D) - affine.of_block(own.start, D)
            own = scaled(0.5 / length, product(own.name, d, d, length**2))  # so it is in m
        yield own


@lru_cache(maxsize=1024)
def _rigid(shape: Shape) -> tuple[Constraint, ...]:
    """The rows of every body of a shape, on its own blocks, of which {n} in a name is the n-th."""
    D, local = shape.inverse.shape[1], shape.local
    found: list[Constraint] = []
    before: list[tuple[int, Form]] = []
    for n, (end, is_point) in enumerate(zip(shape.ends, shape.is_point, strict=True)):
        d = affine.of_block(end, D)
        if is_point:
            d = d - affine.of_block(0, D)
            name = 'length' if n == 0 else f'{{{end}}}_length'
            found.append(Distance(name, 0, end, float(np.linalg.norm(local[end]))))
        for other, e in before:
            name = f'{{{other}}}_{{{end}}}'
            found.append(product(name, e, d, float(local[end] @ local[other])))
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

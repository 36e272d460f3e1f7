"""Joint coordinates: continuous angles, turns counted, and lengths.

An angle is atan2(y, x) of two rows, x and y; the kernel counts the passages of (x, y) over the
negative x axis. In the plane these are the x axes of the bodies, and the coordinate of a joint is
the child's angle minus the parent's; in space they are the child's x axis in the parent's frame of
the joint, so that the coordinate is zero as drawn.
"""

from __future__ import annotations

import numpy as np

from alf_ros.kernel import Rows
from alf_ros.mechanism import Coordinate, Joint, affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.memory import remembered
from alf_ros.mechanism.natural_coordinates import Layout, Shape, direction
from alf_ros.model.constraints.packing import of_shapes, rows_of
from alf_ros.model.constraints.row import Row, linear, product
from alf_ros.model.constraints.velocity_integral import Axes, angle_between, rate_between
from alf_ros.model.joints import type_of


def counted(layout: Layout) -> Rows:
    """The rows x, y of every angle whose turns are counted."""
    if layout.dimension == 2:
        return of_shapes(layout, _turned)
    return rows_of(counted_rows(layout), layout)[0]


def counted_rows(layout: Layout) -> list[Row]:
    """The rows of `counted`, one by one: large mechanisms have many bodies of one shape."""
    if layout.dimension == 2:
        turned = [(body, _turned(layout.shape(body.name))) for body in layout.bodies]
        return [row.on(layout.of_body[body.name], '') for body, rows in turned for row in rows]
    angles = (each for each in layout.mechanism.coordinates if each.is_angle)
    return [row for each in angles for row in angle_rows(each, layout)]


def angle_rows(coordinate: Coordinate, layout: Layout) -> list[Row]:
    """The rows x, y of the angle of a joint coordinate, and of the angle subtracted from it."""
    if layout.dimension == 2:
        bodies = [layout.bodies[n].name for n in (coordinate.place, coordinate.less) if n >= 0]
        return [
            row.on(layout.of_body[body], body)
            for body in bodies
            for row in _turned(layout.shape(body))
        ]
    if _in_a_sum(coordinate, layout):
        return [*angle_between(1.0, *turning_axes(coordinate.joint, layout)).rows]
    X, Y, d = angle_axes(coordinate, layout)
    return [product('x', X, d), product('y', Y, d)]


def _in_a_sum(coordinate: Coordinate, layout: Layout) -> bool:
    """Whether a row of velocities keeps a sum with this angle constant: it is counted once."""
    bound = type_of(coordinate.joint).integral is not None
    return bound or coordinate.name in layout.mechanism.coupled


@remembered(1024)
def _turned(shape: Shape) -> list[Row]:
    """x, y of the x axis of bodies of a shape in the plane, on their own blocks."""
    d = direction(shape, (1.0, 0.0)) if shape.ends else affine.constant((1.0, 0.0))
    return [linear('', axis, d) for axis in np.eye(2)]


def _axes(joint: Joint, layout: Layout) -> tuple[list[Form], list[Form]]:
    """The axes of the joint on the parent and on the child."""
    both = zip((joint.parent, joint.child), joint.frames, strict=True)
    parent, child = ([layout.direction(body, a) for a in frame.axes] for body, frame in both)
    return parent, child


def angle_axes(coordinate: Coordinate, layout: Layout) -> tuple[Form, Form, Form]:
    """Directions X, Y and d of which a joint coordinate is the angle atan2(Y·d, X·d)."""
    joint = coordinate.joint
    if layout.dimension == 3:
        parent, child = _axes(joint, layout)
        if coordinate.freedom.on_child:  # about the child's x
            return child[2], child[1], parent[2]
        return parent[0], parent[1], child[0]
    (X, Y), (d, _) = turning_axes(joint, layout)
    return X, Y, d


def turning_axes(joint: Joint, layout: Layout) -> tuple[Axes, Axes]:
    """Axes of the parent and of the child that turn against each other in one plane, if the joint
    has one angle."""
    if layout.dimension == 3:
        parent, child = ((x, y) for x, y, _ in _axes(joint, layout))
        return parent, child
    parent, child = (
        (layout.direction(body, (1.0, 0.0)), layout.direction(body, (0.0, 1.0)))
        for body in (joint.parent, joint.child)
    )
    return parent, child


def length_row(joint: Joint, layout: Layout) -> Row:
    """How far the child is along x of the parent's frame in the plane, along z in space."""
    base, tip = joint.frames
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    axis = layout.direction(joint.parent, base.axes[0 if layout.dimension == 2 else 2])
    return product(joint.name, axis, gap)


def rate(coordinate: Coordinate, unit: float, layout: Layout) -> list[tuple[Form, Form]]:
    """Pairs of forms whose Σ f · ġ is `unit` times ẋ.

    Raises ValueError for one of two angles: it depends on the other.
    """
    joint = coordinate.joint
    if not coordinate.is_angle:
        (base, tip), D = joint.frames, layout.dimension
        axis = layout.direction(joint.parent, base.axes[0 if D == 2 else 2])
        gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
        return [(axis.times(unit), gap), (gap.times(unit), axis)]
    if not coordinate.freedom.alone:
        raise ValueError(
            f'{coordinate.name!r} is one of two angles: neither rotor nor coupling takes it'
        )
    return rate_between(unit, *turning_axes(joint, layout))

"""Joint coordinates: continuous angles, turns counted, and lengths.

An angle is measured by two rows, x and y, of which it is atan2(y, x); the kernel counts the
passages of (x, y) over the negative x axis. In the plane these are the x axes of the bodies, and
the coordinate of a joint is the child's angle less the parent's; in space they are the child's x
axis in the parent's frame of the joint, so that the coordinate is zero as drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from alf_ros import form
from alf_ros.form import Form
from alf_ros.layout import Layout
from alf_ros.mechanism import GROUND, Joint
from alf_ros.row import Row, linear, product

LENGTHS = ('slider', 'prismatic', 'cylindrical')
ANGLES = ('revolute', 'cylindrical', 'universal')


@dataclass(frozen=True)
class Coordinate:
    """One freedom of a joint: an angle (rad), at `place` less that at `less`, or a length (m).

    `place` counts angles or lengths, whichever it is; `less` is -1 for none.
    """

    name: str
    joint: Joint
    is_angle: bool
    place: int
    less: int = -1


Measured = tuple[tuple[Coordinate, ...], tuple[Row, ...], tuple[Row, ...]]
_COORDINATES: WeakKeyDictionary[Layout, tuple[Coordinate, ...]] = WeakKeyDictionary()
_MEASURED: WeakKeyDictionary[Layout, Measured] = WeakKeyDictionary()


def coordinates(layout: Layout) -> tuple[Coordinate, ...]:
    """The coordinates of all joints, made once for a layout."""
    if layout not in _COORDINATES:
        _COORDINATES[layout] = tuple(_coordinates(layout))
    return _COORDINATES[layout]


def measured(layout: Layout) -> Measured:
    """The coordinates of all joints, the rows x, y of each angle, and the row of each length.

    Made once for a layout: each command to a joint asks for them.
    """
    if layout not in _MEASURED:
        _MEASURED[layout] = _measured(layout)
    return _MEASURED[layout]


def _coordinates(layout: Layout) -> Iterator[Coordinate]:
    body = {body.name: n for n, body in enumerate(layout.bodies)}
    planar, angles, lengths = layout.dimension == 2, 0, 0
    for joint in layout.mechanism.joints:
        several = _count(joint, planar) > 1
        if joint.kind in ANGLES and planar:
            less = body.get(joint.parent, -1) if joint.parent != GROUND else -1
            yield Coordinate(joint.name, joint, True, body[joint.child], less)
        elif joint.kind in ANGLES:
            for suffix in ('first', 'second') if joint.kind == 'universal' else ('angle',):
                name = f'{joint.name}_{suffix}' if several else joint.name
                yield Coordinate(name, joint, True, angles)
                angles += 1
        if joint.kind in LENGTHS:
            name = f'{joint.name}_length' if several else joint.name
            yield Coordinate(name, joint, False, lengths)
            lengths += 1


def _measured(layout: Layout) -> Measured:
    found = coordinates(layout)
    angles: list[Row] = []
    if layout.dimension == 2:
        for each in layout.bodies:
            d = form.constant((1.0, 0.0))
            if layout.turns(each.name):
                d = layout.direction(each.name, (1.0, 0.0))
            angles += [linear(each.name, axis, d) for axis in np.eye(2)]
    else:
        for coordinate in found:
            if coordinate.is_angle:
                X, Y, d = angle_axes(coordinate, layout)
                angles += [product('x', X, d), product('y', Y, d)]
    lengths = [length_row(each.joint, layout) for each in found if not each.is_angle]
    return found, tuple(angles), tuple(lengths)


def _count(joint: Joint, planar: bool) -> int:
    if joint.kind == 'universal':
        return 2
    return (joint.kind in ANGLES) + (joint.kind in LENGTHS)


def _axes(joint: Joint, layout: Layout) -> tuple[list[Form], list[Form]]:
    """The axes of the joint on the parent and on the child."""
    both = zip((joint.parent, joint.child), joint.frames, strict=True)
    parent, child = ([layout.direction(body, a) for a in frame.axes] for body, frame in both)
    return parent, child


def coordinate_of(name: str, layout: Layout) -> Coordinate:
    """The joint coordinate of a name."""
    return next(each for each in coordinates(layout) if each.name == name)


def angle_axes(coordinate: Coordinate, layout: Layout) -> tuple[Form, Form, Form]:
    """Directions X, Y and d of which a joint coordinate is the angle atan2(Y·d, X·d)."""
    joint = coordinate.joint
    if layout.dimension == 3:
        suffix = 'second' if coordinate.name == f'{joint.name}_second' else ''
        return _measured_from(joint, suffix, layout)
    X, Y = (layout.direction(joint.parent, axis) for axis in ((1.0, 0.0), (0.0, 1.0)))
    return X, Y, layout.direction(joint.child, (1.0, 0.0))


def _measured_from(joint: Joint, suffix: str, layout: Layout) -> tuple[Form, Form, Form]:
    parent, child = _axes(joint, layout)
    if suffix == 'second':  # about the child's x, which is the cross of a universal joint
        return child[2], child[1], parent[2]
    return parent[0], parent[1], child[0]


def length_row(joint: Joint, layout: Layout) -> Row:
    """How far the child is along x of the parent's frame in the plane, along z in space."""
    base, tip = joint.frames
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    axis = layout.direction(joint.parent, base.axes[0 if layout.dimension == 2 else 2])
    return product(joint.name, axis, gap)

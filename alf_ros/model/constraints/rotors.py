"""The inertia of rotors that are geared to joints.

A rotor is a block of its own, of which the first component z goes as the coordinate x of its joint
does: ż = ẋ, a row of velocities, for only its kinetic energy counts. So M stays constant, also
where the joint is between two bodies that move.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.mechanism import GROUND, Coordinate, Rotor, affine
from alf_ros.mechanism.affine import Form
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.row import Row, linear, motion


def rotor_rows(rotor: Rotor, layout: Layout) -> Iterator[Row]:
    """ż = ẋ, and the other components stay where they are."""
    D = layout.dimension
    z = affine.of_block(layout.of_auxiliary[rotor.name], D)
    coordinate = layout.mechanism.coordinate[rotor.of]
    x = np.eye(D)[0]
    unit = unit_of(coordinate, layout)
    yield motion(rotor.name, (affine.constant(tuple(-x)), z), *_rate(coordinate, unit, layout))
    for axis, e in zip('yz', np.eye(D)[1:], strict=False):
        yield linear(f'{rotor.name}_{axis}', e, z)


def unit_of(coordinate: Coordinate, layout: Layout) -> float:
    """What z is of x: of an angle the length of the drawing, for all coordinates are lengths."""
    return layout.length if coordinate.is_angle else 1.0


def _rate(coordinate: Coordinate, unit: float, layout: Layout) -> list[tuple[Form, Form]]:
    """Pairs of forms whose Σ f · ġ is `unit` times ẋ.

    Raises ValueError for one of two angles: it depends on the other.
    """
    joint = coordinate.joint
    (base, tip), D = joint.frames, layout.dimension
    if not coordinate.is_angle:
        axis = layout.direction(joint.parent, base.axes[0 if D == 2 else 2])
        gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
        return [(axis, gap), (gap, axis)]
    if not coordinate.freedom.alone:
        raise ValueError(f'{coordinate.name!r} is one of two angles: no rotor is geared to it')
    pairs = []
    for body, frame, sign in ((joint.child, tip, unit), (joint.parent, base, -unit)):
        if body != GROUND:  # about the axis that the joint does not move: ω = u̇_x · u_y
            x, y = (layout.direction(body, axis) for axis in frame.axes[:2])
            pairs.append((y.times(sign), x))
    return pairs

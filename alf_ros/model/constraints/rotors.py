"""The inertia of rotors that are geared to joints.

A rotor is a block of its own, of which the first component z goes as the coordinate x of its joint
does: ż = ẋ, a row of velocities, for only its kinetic energy counts. So M stays constant, also
where the joint is between two bodies that move.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.mechanism import Coordinate, Rotor, affine
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.joint_coordinates import rate
from alf_ros.model.constraints.row import Row, linear, motion


def rotor_rows(rotor: Rotor, layout: Layout) -> Iterator[Row]:
    """ż = ẋ, and the other components stay where they are."""
    D = layout.dimension
    z = affine.of_block(layout.of_auxiliary[rotor.name], D)
    coordinate = layout.mechanism.coordinate[rotor.of]
    x = np.eye(D)[0]
    unit = unit_of(coordinate, layout)
    yield motion(rotor.name, (affine.constant(tuple(-x)), z), *rate(coordinate, unit, layout))
    for axis, e in zip('yz', np.eye(D)[1:], strict=False):
        yield linear(f'{rotor.name}_{axis}', e, z)


def unit_of(coordinate: Coordinate, layout: Layout) -> float:
    """The factor of z = factor · x: for an angle the length of the drawing, because all
    coordinates are lengths."""
    return layout.length if coordinate.is_angle else 1.0

"""The inertia of rotors that are geared to joints.

A rotor is a block of its own, of which the first component z goes as the coordinate x of its joint
does: ż = ẋ, a row of velocities, for only its kinetic energy counts. So M stays constant, also
where the joint is between two bodies that move.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.arrays import Floats
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


def rotor_blocks(layout: Layout) -> list[int]:
    """Only rates bind these blocks: they are at another place after a turn."""
    return [layout.of_auxiliary[rotor.name] for rotor in layout.mechanism.rotors]


def without_rotors(layout: Layout, q: Floats) -> Floats:
    """(other blocks, D) of q (blocks D,), m."""
    return np.delete(q.reshape(-1, layout.dimension), rotor_blocks(layout), axis=0)


def unit_of(coordinate: Coordinate, layout: Layout) -> float:
    """The factor of z = factor · x: for an angle the length of the drawing, because all
    coordinates are lengths."""
    return layout.length if coordinate.is_angle else 1.0

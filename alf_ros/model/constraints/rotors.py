"""The inertia of rotors that are geared to joints.

A rotor is a block of its own, of which the first component z goes as the coordinates x of its
joints do: ż = Σ a ẋ, a row of velocities, for only its kinetic energy counts. So M stays constant,
also where a joint is between two bodies that move.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Rotor, affine
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.joint_coordinates import rate
from alf_ros.model.constraints.row import Row, linear, motion


def rotor_rows(rotor: Rotor, layout: Layout) -> Iterator[Row]:
    """ż = Σ a ẋ, and the other components stay where they are. Raises ValueError for one of two
    angles: it depends on the other."""
    D = layout.dimension
    z = affine.of_block(layout.of_auxiliary[rotor.name], D)
    coordinate, unit = layout.mechanism.coordinate, unit_of(rotor, layout)
    x = np.eye(D)[0]
    pairs = [pair for name, a in rotor.of for pair in rate(coordinate[name], a * unit, layout)]
    yield motion(rotor.name, (affine.constant(tuple(-x)), z), *pairs)
    for axis, e in zip('yz', np.eye(D)[1:], strict=False):
        yield linear(f'{rotor.name}_{axis}', e, z)


def rotor_blocks(layout: Layout) -> list[int]:
    """Only rates bind these blocks: they are at another place after a turn."""
    return [layout.of_auxiliary[rotor.name] for rotor in layout.mechanism.rotors]


def without_rotors(layout: Layout, q: Floats) -> Floats:
    """(other blocks, D) of q (blocks D,), m."""
    return np.delete(q.reshape(-1, layout.dimension), rotor_blocks(layout), axis=0)


def unit_of(rotor: Rotor, layout: Layout) -> float:
    """The factor of z = factor · Σ a x: where the first coordinate is an angle the length of the
    drawing, because all coordinates are lengths."""
    first, _ = rotor.of[0]
    return layout.length if layout.mechanism.coordinate[first].is_angle else 1.0

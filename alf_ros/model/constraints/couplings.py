"""Linear couplings of joint coordinates: Σ a_n x_n stays what it is as drawn.

No row of second order knows the angle itself, only its sine and cosine, so the row binds
velocities, Σ a_n ẋ_n = 0, and can be integrated: what it holds drifts by the error of the
integrator. A row is in m/s: where the first coordinate is an angle it is times the length of the
drawing. Its force is an effort a_n λ on each coordinate.
"""

from __future__ import annotations

import math

from alf_ros.arrays import Floats
from alf_ros.mechanism import Coordinate, Coupling
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.joint_coordinates import angle_axes, length_row, rate
from alf_ros.model.constraints.row import Row, motion, value


def coupling_row(coupling: Coupling, layout: Layout) -> Row:
    """Σ a_n ẋ_n = 0. Raises ValueError for one of two angles: it depends on the other."""
    coordinate, unit = layout.mechanism.coordinate, unit_of(coupling, layout)
    pairs = [pair for name, a in coupling.of for pair in rate(coordinate[name], a * unit, layout)]
    return motion(coupling.name, *pairs)


def unit_of(coupling: Coupling, layout: Layout) -> float:
    """The factor that makes a length, m, of the first coordinate."""
    first, _ = coupling.of[0]
    return layout.length if layout.mechanism.coordinate[first].is_angle else 1.0


def advance(coupling: Coupling, layout: Layout) -> float:
    """m/rad, of the coordinate that goes fastest along the one that goes slowest; an angle counts
    as a length at the size of the drawing."""
    coordinate = layout.mechanism.coordinate
    factors = [
        abs(a) / (layout.length if coordinate[name].is_angle else 1.0) for name, a in coupling.of
    ]
    return layout.length * min(factors) / max(factors)


def slip(coupling: Coupling, layout: Layout, before: Floats, after: Floats) -> float:
    """m, by how much Σ a_n x_n has changed from q to q (blocks, D), by half a turn at most."""
    coordinate = layout.mechanism.coordinate
    change = sum(a * _change(coordinate[name], layout, before, after) for name, a in coupling.of)
    return unit_of(coupling, layout) * change


def _change(coordinate: Coordinate, layout: Layout, before: Floats, after: Floats) -> float:
    """Of a coordinate, rad or m."""
    if not coordinate.is_angle:
        row = length_row(coordinate.joint, layout)
        return value(row, after) - value(row, before)
    X, Y, d = angle_axes(coordinate, layout)
    first, last = (
        math.atan2(Y.value(q) @ d.value(q), X.value(q) @ d.value(q)) for q in (before, after)
    )
    return math.remainder(last - first, 2.0 * math.pi)

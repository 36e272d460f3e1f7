"""Linear couplings of joint coordinates: Σ a_n x_n stays what it is as drawn.

No row of second order knows the angle itself, only its sine and cosine. So the row binds
velocities, Σ a_n ẋ_n = 0; the kernel keeps its integral at its value (`kernel/slip.py`). A row is
in m/s: where the first coordinate is an angle it is times the length of the drawing. Its force
is an effort a_n λ on each coordinate.
"""

from __future__ import annotations

from alf_ros.mechanism import Coordinate, Coupling
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints.joint_coordinates import length_row, rate, turning_axes
from alf_ros.model.constraints.row import Row, motion
from alf_ros.model.constraints.velocity_integral import IntegralTerm, angle_between


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


def integral(coupling: Coupling, layout: Layout) -> list[IntegralTerm]:
    """Σ a_n x_n, m."""
    coordinate, unit = layout.mechanism.coordinate, unit_of(coupling, layout)
    return [_term(coordinate[name], a * unit, layout) for name, a in coupling.of]


def _term(coordinate: Coordinate, factor: float, layout: Layout) -> IntegralTerm:
    if not coordinate.is_angle:
        return IntegralTerm(factor, (length_row(coordinate.joint, layout),))
    return angle_between(factor, *turning_axes(coordinate.joint, layout))

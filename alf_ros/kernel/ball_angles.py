"""The angles of balls that stand for three revolutes in a row, with their rates."""

from __future__ import annotations

import math

import numpy as np

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import value_and_rate
from alf_ros.kernel.data import BallAngles, Rows
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, compiled, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import vector


@compiled
def ball_angles(
    unit: Unit,
    balls: BallAngles,
    q: Floats,
    qd: Floats,
    first: np.uint64,
    angles: Floats,
    rates: Floats,
) -> None:
    """Write three angles (rad) of each ball, from place `first` on, and their rates (rad/s).

    e₁ is z of the frame on the parent, e₃ is fixed to the child, and e₂ is at a right angle to
    both. On the parent e₃ is (sin φ sin θ₁, -sin φ cos θ₁, cos φ), with the angle φ from e₁ to e₃
    about e₂. Where e₁ and e₃ align (gimbal lock) any θ₁ would do, and θ₃ is the rest: the three
    angles always give the orientation. There the rates of θ₁ and θ₃ are not a number.
    """
    q, qd = vector(q), vector(qd)
    for n in each(0, balls.tilt.size):
        tilt, place, row = balls.tilt[n], first + THREE * n, THREE * THREE * n
        (x0, x1, _), (u0, u1, u2) = _direction(unit, balls.axes, row, q, qd)
        (y0, y1, y2), _ = _direction(unit, balls.axes, row + THREE, q, qd)
        (e0, e1, e2), (v0, v1, v2) = _direction(unit, balls.axes, row + TWO * THREE, q, qd)
        sign = -1.0 if tilt < 0.0 else 1.0  # φ stays in the half turn in which it is drawn
        across = e0 * e0 + e1 * e1
        theta = math.atan2(sign * e0 + 0.0, 0.0 - sign * e1)
        c, s = math.cos(theta), math.sin(theta)  # of e₂ on the parent
        spin = (e0 * v1 - e1 * v0) / across if across > 0.0 else np.nan
        angles[place], rates[place] = theta, spin
        angles[place + ONE] = math.atan2(sign * math.sqrt(across), e2) - tilt
        rates[place + ONE] = e2 * (s * v0 - c * v1) + (c * e1 - s * e0) * v2
        angles[place + TWO] = math.atan2(-(y0 * c + y1 * s), x0 * c + x1 * s)
        rates[place + TWO] = u0 * y0 + u1 * y1 + u2 * y2 - e2 * spin


@inner
def _direction(
    unit: Unit, axes: Rows, row: np.uint64, q: Floats, qd: Floats
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """A direction of the child in the frame on the parent, and its rate (1/s) there."""
    x, xd = value_and_rate(unit, axes, row, q, qd)
    y, yd = value_and_rate(unit, axes, row + ONE, q, qd)
    z, zd = value_and_rate(unit, axes, row + TWO, q, qd)
    return (x, y, z), (xd, yd, zd)

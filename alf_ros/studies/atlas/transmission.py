"""How motion and effort go from the input to an output, and through a bar: definitions.

Along a curve of positions with tangent t, u' and w' are the rates of the input and of the output.

- velocity ratio: w' / u'. It is zero at a dead point of the output, and infinite where the input
  turns back.
- mechanical advantage: u' / w', the effort of the output that holds one unit of effort of the
  input in balance, without friction, weights or springs (power in is power out).
- transmission angle of a bar between two pins that carries no other load, so that its force goes
  from pin to pin: sin μ = |e · v| / |v|, with e the direction from pin to pin and v the velocity
  of the pin at the output end. In a four-bar μ is the angle between coupler and rocker, from 0 to
  90°. It is not defined where that pin does not move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.mechanism import Mechanism
from alf_ros.model.compile import Model

_STILL = 1e-9  # speed of a pin, of the fastest coordinate, from which down it does not move


@dataclass(frozen=True)
class Bar:
    """A bar that transmits: its pin at the input end, and its pin at the output end."""

    first: str
    last: str

    def angle(self, model: Model, q: Floats, v: Floats) -> float:
        """The transmission angle (rad, 0 to π/2) at q (blocks D, m), moving along v (blocks D);
        NaN where it is not defined."""
        return angle_of(self.along_and_across(model, q, v))

    def along_and_across(self, model: Model, q: Floats, v: Floats) -> Floats:
        """(D,) e · v / |v|, and the component of v / |v| across e, in space its three (4,). They
        are smooth where the angle has a kink, at 0 and at π/2. NaN where it is not defined."""
        D, of = model.layout.dimension, model.layout.of_point
        places, rates = q.reshape(-1, D), v.reshape(-1, D)
        e, speed = places[of[self.last]] - places[of[self.first]], rates[of[self.last]]
        size = float(np.linalg.norm(speed) * np.linalg.norm(e))
        if size <= _STILL * np.abs(v).max() * float(np.linalg.norm(e)):
            return np.full(2 if D == 2 else 4, math.nan)
        across = [e[0] * speed[1] - e[1] * speed[0]] if D == 2 else np.cross(e, speed)
        return np.array([float(e @ speed), *across]) / size


def angle_of(parts: Floats) -> float:
    """The transmission angle (rad) of `Bar.along_and_across`."""
    return math.atan2(abs(parts[0]), float(np.linalg.norm(parts[1:])))


def slope_of(parts: Floats) -> Floats:
    """The derivative of the angle by these parts; zero by one that is zero, at a kink."""
    across = float(np.linalg.norm(parts[1:]))
    along = -abs(parts[0]) * parts[1:] / (across or 1.0)
    return np.array([across * np.sign(parts[0]), *along])


def bar_between(mechanism: Mechanism, names: object) -> Bar:
    """The bar between two points by name. Raises InputError."""
    points = [point.name for point in mechanism.points]
    listed = list(names) if isinstance(names, (list, tuple)) else []
    if len(listed) != 2 or listed[0] == listed[1]:
        raise InputError('not a bar', key='bar', value=names, expected='two points')
    for name in listed:
        if name not in points:
            raise InputError('no such point', key='bar', value=name, choices=points)
    if not any({*listed} <= {*body.points} for body in mechanism.bodies):
        raise InputError('no body has both points', key='bar', value=', '.join(listed))
    return Bar(*listed)


def ratio(rate: float, of: float) -> float:
    """One rate over another; infinite where the other is zero, NaN where both are."""
    if of != 0.0:
        return rate / of
    return math.nan if rate == 0.0 else math.copysign(math.inf, rate)

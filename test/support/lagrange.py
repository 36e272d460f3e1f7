"""Lagrange's equations of few coordinates, from places in closed form: a reference without solver.

A planar body with its centre of mass at c and the unit vector e along its x axis has the kinetic
energy ½ m ċ² + ½ J ė². All c and e are x(q), with a constant mass matrix W, so that

    Xᵀ W ẍ = Q + Xᵀ W g,   X = ∂x/∂q.

X is made by complex steps. ẍ, the second derivative of x along the motion, is made from values on
two rays of the complex plane. Only masses and their places in the body frames are read from the
mechanism; the test closes the loops, by the law of cosines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Body

Array = np.ndarray[Any, np.dtype[Any]]  # also of complex numbers
Places = Callable[[Array], Mapping[str, Array]]

_RAY, _FAR = np.exp(0.25j * np.pi), 3e-3


def turned(v: Array) -> Array:
    """By a quarter of a turn, counter-clockwise."""
    return np.array([-v[1], v[0]])


def distance(a: Array, b: Array) -> Any:
    """Analytic, so that complex numbers go through."""
    return np.sqrt((b - a) @ (b - a))


def meet(a: Array, ra: Any, b: Array, rb: Any) -> Array:
    """Where circles about a and b meet, on the left of a -> b."""
    d2 = (b - a) @ (b - a)
    along = (ra**2 - rb**2 + d2) / (2.0 * d2)
    return a + along * (b - a) + np.sqrt(ra**2 / d2 - along**2) * turned(b - a)


class Reduced:
    """The bodies of a planar mechanism on `places`: coordinates (k,) to points by name (2,)."""

    def __init__(self, bodies: Sequence[Body], places: Places, gravity: float = 9.81) -> None:
        self.bodies, self.places, self.gravity = bodies, places, gravity
        self.mass = np.array([[b.mass, b.mass, b.inertia, b.inertia] for b in bodies]).ravel()

    def x(self, q: Array) -> Array:
        """(4 bodies,) centre of mass, m, and unit vector of each."""
        at = self.places(q)
        rows = []
        for body in self.bodies:
            first, second = (at[name] for name in body.points[:2])
            e = (second - first) / distance(first, second)
            rows.append([*(first + body.com[0] * e + body.com[1] * turned(e)), *e])
        return np.array(rows).ravel()

    def jacobian(self, q: Floats) -> Floats:
        """X (4 bodies, k)."""
        steps = 1e-30j * np.eye(len(q))
        return np.array([self.x(q + step).imag * 1e30 for step in steps]).T

    def efforts(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """(k,) generalised forces besides the weight that this motion needs."""
        q, qd, qdd = (np.asarray(each, dtype=float) for each in (q, qd, qdd))

        def on_the_way(s: complex) -> Array:
            return self.x(q + s * qd + 0.5 * s * s * qdd)

        there, back = on_the_way(_RAY * _FAR), on_the_way(-_RAY * _FAR)
        acceleration = (there + back).imag / _FAR**2
        acceleration[1::4] += self.gravity
        return self.jacobian(q).T @ (self.mass * acceleration)

    def acceleration(self, q: Floats, qd: Floats, Q: Floats) -> Floats:
        """(k,) q̈ under the generalised forces Q besides the weight."""
        X = self.jacobian(q)
        left = Q - self.efforts(q, qd, np.zeros(len(q)))
        return np.asarray(np.linalg.solve(X.T @ (self.mass[:, None] * X), left), dtype=float)

"""Lagrange's equations of few coordinates, from places in closed form: a reference without solver.

All masses are at coordinates x(q) with a constant, diagonal mass matrix W and constant weights w.
In the plane, x holds the centre of mass c of each body and the unit vector e along its x axis, as
its kinetic energy is ½ m ċ² + ½ J ė². Then

    Xᵀ (W ẍ - w) = Q,   X = ∂x/∂q.

X is made by complex steps. ẍ, the second derivative of x along the motion, is made from values on
two rays of the complex plane. The tests close the loops, by the law of cosines.
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
    """Masses (n,), kg or kg m², at x(q) (n,) under weights (n,), N or N m."""

    def __init__(self, x: Callable[[Array], Array], mass: Floats, weight: Floats) -> None:
        self.x, self.mass, self.weight = x, mass, weight

    def jacobian(self, q: Floats) -> Floats:
        """X (n, k)."""
        steps = 1e-30j * np.eye(len(q))
        return np.array([self.x(q + step).imag * 1e30 for step in steps]).T

    def efforts(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """(k,) generalised forces besides the weight that this motion needs."""
        return self.jacobian(q).T @ self._forces(q, qd, qdd)

    def acceleration(self, q: Floats, qd: Floats, Q: Floats) -> Floats:
        """(k,) q̈ under the generalised forces Q besides the weight."""
        X = self.jacobian(q)
        left = Q - X.T @ self._forces(q, qd, np.zeros(len(q)))
        return np.asarray(np.linalg.solve(X.T @ (self.mass[:, None] * X), left), dtype=float)

    def _forces(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """W ẍ - w (n,) of this motion."""
        q, qd, qdd = (np.asarray(each, dtype=float) for each in (q, qd, qdd))

        def on_the_way(s: complex) -> Array:
            return self.x(q + s * qd + 0.5 * s * s * qdd)

        there, back = on_the_way(_RAY * _FAR), on_the_way(-_RAY * _FAR)
        return np.asarray(self.mass * (there + back).imag / _FAR**2 - self.weight, dtype=float)


def planar(bodies: Sequence[Body], places: Places, gravity: float = 9.81) -> Reduced:
    """Bodies of the plane on `places`: coordinates (k,) to points by name (2,), m.

    Their masses and centres of mass in the body frames are read; gravity (m/s²) acts along -y.
    """

    def x(q: Array) -> Array:
        at = places(q)
        rows = []
        for body in bodies:
            first, second = (at[name] for name in body.points[:2])
            e = (second - first) / distance(first, second)
            rows.append([*(first + body.com[0] * e + body.com[1] * turned(e)), *e])
        return np.array(rows).ravel()

    mass = np.array([[b.mass, b.mass, b.inertia, b.inertia] for b in bodies])
    weight = np.array([[0.0, -gravity * b.mass, 0.0, 0.0] for b in bodies])
    return Reduced(x, mass.ravel(), weight.ravel())

"""Exact motions: a mechanism reduced by hand to its one angle, whose equation is integrated alone.

It has no constraints, so the singular positions of the mechanism are ordinary points. Sizes are
the same as in config: rods of 1 m and 1 kg, gravity 9.81 m/s^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from alf_ros.arrays import Floats

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True)
class OneFreedom:
    """A mechanism as a function of one angle θ.

    acceleration: θ (rad), θ̇ (rad/s) -> θ̈ (rad/s^2). position: θ -> q (n,), m, in the order of the
    mechanism's file. tangent: θ -> dq/dθ (n,), m/rad. inertia: θ -> I (kg m²) and dI/dθ, of the
    kinetic energy ½ I θ̇².
    """

    acceleration: Callable[[float, float], float]
    position: Callable[[float], Floats]
    tangent: Callable[[float], Floats]
    inertia: Callable[[float], tuple[float, float]]

    def course(self, theta: float, rate: float, times: ArrayLike) -> Floats:
        """θ (rad), θ̇ (rad/s) at ascending `times` (s), from θ, θ̇ at time 0: (2, times)."""
        return _integrate(lambda t, y: (y[1], self.acceleration(y[0], y[1])), (theta, rate), times)

    def angles(self, theta: float, rate: float, times: ArrayLike) -> Floats:
        """θ (rad) at ascending `times` (s) after a start at time 0, at θ (rad) with θ̇ (rad/s)."""
        angles: Floats = self.course(theta, rate, times)[0]
        return angles

    def motion(self, theta: float, rate: float, times: ArrayLike) -> Floats:
        """Coordinates q (times, n), m, of the same motion."""
        return np.array([self.position(angle) for angle in self.angles(theta, rate, times)])


def _integrate(
    rates: Callable[[float, Floats], Sequence[float]], start: Sequence[float], times: ArrayLike
) -> Floats:
    """y (components, times) of ẏ = rates(t, y), good to 1e-12 over 10 s.

    The tolerance alone would leave 3e-11, so the step is bounded too.
    """
    instants = np.asarray(times, dtype=float)
    found = solve_ivp(
        rates,
        (0.0, instants[-1]),
        start,
        method='DOP853',
        t_eval=instants,
        rtol=1e-13,
        atol=1e-15,
        max_step=5e-3,
    )
    return np.asarray(found.y)


def slider_crank() -> OneFreedom:
    """6.2 of the paper, θ the angle of the crank: A = (cos θ, sin θ), B = (2 cos θ, 0).

    E = θ̇² (1/3 + sin² θ) + g sin θ, so θ̈ = -cos θ (2 sin θ θ̇² + g) / (2/3 + 2 sin² θ).
    """

    def acceleration(theta: float, rate: float) -> float:
        sin, cos = np.sin(theta), np.cos(theta)
        return float(-cos * (2.0 * sin * rate * rate + GRAVITY) / (2.0 / 3.0 + 2.0 * sin * sin))

    return OneFreedom(
        acceleration,
        lambda theta: np.array([np.cos(theta), np.sin(theta), 2.0 * np.cos(theta), 0.0]),
        lambda theta: np.array([-np.sin(theta), np.cos(theta), -2.0 * np.sin(theta), 0.0]),
        lambda theta: (2.0 / 3.0 + 2.0 * np.sin(theta) ** 2, 2.0 * np.sin(2.0 * theta)),
    )


def four_bars(n: int) -> OneFreedom:
    """`n` four-bars side by side (6.3 of the paper: n = 2), B_k = (k + cos θ, sin θ), k = 0 .. n.

    Cranks turn together and couplers only translate: a pendulum of inertia (n + 1)/3 + n and
    first moment (n + 1)/2 + n, so θ̈ = -g cos θ 3 (3n + 1) / (2 (4n + 1)).
    """
    stiffness = GRAVITY * 3.0 * (3 * n + 1) / (2.0 * (4 * n + 1))

    def repeated(x: float, y: float, spacing: float) -> Floats:
        k = np.arange(n + 1)
        return np.stack([x + spacing * k, np.full(n + 1, y)], axis=1).ravel()

    return OneFreedom(
        lambda theta, rate: float(-stiffness * np.cos(theta)),
        lambda theta: repeated(np.cos(theta), np.sin(theta), 1.0),
        lambda theta: repeated(-np.sin(theta), np.cos(theta), 0.0),
        lambda theta: ((n + 1) / 3.0 + n, 0.0),
    )


def change_point_alone() -> OneFreedom:
    """The four-bar `change_point` as a function of the angle φ of its crank.

    With f = |AC| the law of cosines puts B at x along AC and y to its left, x = (f² + b² - c²)/2f,
    4 f² y² = (b + c - f)(b + c + f)(f + c - b)(f + b - c). As a + d = b + c, the first two factors
    are 4 a d cos²(φ/2): in the motion straight through the change point, y has the sign of
    cos(φ/2), a smooth function of φ with period 4π.
    """
    crank, coupler, rocker = 1.0, 1.0, 2.0  # kg

    def tangent(phi: float) -> Floats:
        # complex step: dq/dφ without rounding
        return np.asarray(_change_point(phi + 1e-30j).imag * 1e30)

    def inertia(phi: float) -> float:
        dq = tangent(phi)
        aa, ab, bb = dq[:2] @ dq[:2], dq[:2] @ dq[2:], dq[2:] @ dq[2:]
        return float((crank * aa + coupler * (aa + ab + bb) + rocker * bb) / 3.0)

    def inertia_and_slope(phi: float) -> tuple[float, float]:
        e = 1e-3  # differences of order 6
        slope = 45.0 * (inertia(phi + e) - inertia(phi - e))
        slope -= 9.0 * (inertia(phi + 2 * e) - inertia(phi - 2 * e))
        slope += inertia(phi + 3 * e) - inertia(phi - 3 * e)
        return inertia(phi), slope / (60.0 * e)

    def acceleration(phi: float, rate: float) -> float:
        whole, slope = inertia_and_slope(phi)
        dq = tangent(phi)
        pull = 0.5 * GRAVITY * (crank * dq[1] + coupler * (dq[1] + dq[3]) + rocker * dq[3])
        return float(-(0.5 * slope * rate * rate + pull) / whole)

    return OneFreedom(
        acceleration, lambda phi: _change_point(phi).real, tangent, inertia_and_slope
    )


def _change_point(phi: complex) -> NDArray[np.complex128]:
    """A and B (4,), m."""
    a, b, c, d = 1.0, 2.0, 3.0, 4.0
    cos, sin = np.cos(phi), np.sin(phi)
    f = np.sqrt(a * a + d * d - 2.0 * a * d * cos)
    x = (f * f + b * b - c * c) / (2.0 * f)
    y = np.cos(phi / 2.0) * np.sqrt(a * d * (f + c - b) * (f + b - c)) / f
    along = np.array([d - a * cos, -a * sin]) / f
    A = np.array([a * cos, a * sin])
    return np.concatenate([A, A + x * along + y * np.array([-along[1], along[0]])])


def change_point(times: ArrayLike) -> Floats:
    """Coordinates q (times, 4), m, of A and B in the scene `change_point`, at `times` (s).

    The crank never turns back, so φ̇ = √(2 (E - V(φ)) / I(φ)) (see `change_point_alone`).
    """
    crank, coupler, rocker = 1.0, 1.0, 2.0  # kg

    def inertia_and_potential(phi: float) -> tuple[float, float]:
        whole = _change_point(phi + 1e-30j)  # complex step: dq/dφ without rounding
        q, dq = whole.real, whole.imag * 1e30
        aa, ab, bb = dq[:2] @ dq[:2], dq[:2] @ dq[2:], dq[2:] @ dq[2:]
        inertia = (crank * aa + coupler * (aa + ab + bb) + rocker * bb) / 3.0
        height = crank * q[1] + coupler * (q[1] + q[3]) + rocker * q[3]
        return float(inertia), float(0.5 * GRAVITY * height)

    def rate(t: float, y: Floats) -> tuple[float]:
        inertia, potential = inertia_and_potential(y[0])
        return (math.sqrt(2.0 * (energy - potential) / inertia),)

    start = math.pi / 3.0
    inertia, potential = inertia_and_potential(start)
    energy = 0.5 * inertia * 5.0**2 + potential
    return np.array([_change_point(phi).real for phi in _integrate(rate, (start,), times)[0]])

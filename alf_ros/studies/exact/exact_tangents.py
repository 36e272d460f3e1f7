"""Exact derivatives of motions with one freedom: the variational equation of their one angle,
derived by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from alf_ros.arrays import Floats

GRAVITY = 9.81  # m/s²
_TINY = 1e-30  # complex step: derivatives without rounding

# θ, θ̇ and the parameters -> θ̈
Acceleration = Callable[..., complex]


@dataclass(frozen=True)
class ExactTangents:
    """A scene, times (s), its q (times, n) and the derivatives of q by the numbers in `names`."""

    scene: str
    times: Floats
    names: tuple[str, ...]
    q: Floats
    dq: tuple[Floats, ...]


def slider_crank(duration: float) -> ExactTangents:
    """Section 6.2 of the paper with masses m₁, m₂ of crank and coupler; θ̇₀ = -ẋ_B / (2 sin θ₀).

    E = ½ (m₁/3 + m₂ (1/3 + 2 sin² θ)) θ̇² + ½ (m₁ + m₂) g sin θ.
    """

    def acceleration(theta: complex, rate: complex, m1: complex, m2: complex, g: complex) -> Any:
        sin, cos = np.sin(theta), np.cos(theta)
        inertia = m1 / 3.0 + m2 * (1.0 / 3.0 + 2.0 * sin * sin)
        pull = 2.0 * m2 * sin * cos * rate * rate + 0.5 * (m1 + m2) * g * cos
        return -pull / inertia

    start = np.pi / 4.0, 2.0 * np.sqrt(2.0)
    by_start = [(0.0, 0.0)] * 3 + [(0.0, -0.5 / np.sin(start[0]))]
    times = _times(duration)
    theta, change = _solved(acceleration, (1.0, 1.0, GRAVITY), start, by_start, times)
    sin, cos, zero = np.sin(theta), np.cos(theta), 0.0 * theta
    q = np.stack([cos, sin, 2.0 * cos, zero], axis=1)
    along = np.stack([-sin, cos, -2.0 * sin, zero], axis=1)
    names = ('crank.mass', 'coupler.mass', 'gravity.acceleration.1', 'initial.velocities.B.0')
    signs = (1.0, 1.0, -1.0, 1.0)
    dq = tuple(s * along * each[:, None] for s, each in zip(signs, change, strict=True))
    return ExactTangents('slider_crank', times, names, q, dq)


def double_four_bar(duration: float) -> ExactTangents:
    """Section 6.3 with masses m of the first crank and M of the first coupler, and the length L of
    all bars: a pendulum, θ̈ = -g P cos θ / (I L), I = (m + 2)/3 + M + 1, P = (m + 2)/2 + M + 1.

    The points at the ground move with L; θ̇₀ = -ẋ_B / L.
    """

    def acceleration(
        theta: complex, rate: complex, m: complex, M: complex, g: complex, L: complex
    ) -> Any:
        inertia, moment = (m + 2.0) / 3.0 + M + 1.0, (m + 2.0) / 2.0 + M + 1.0
        return -g * moment * np.cos(theta) / (inertia * L)

    start, times = (np.pi / 2.0, -1.0), _times(duration)
    by_start = [(0.0, 0.0)] * 3 + [(0.0, 1.0)]
    numbers = (1.0, 1.0, GRAVITY, 1.0)
    theta, change = _solved(acceleration, numbers, start, by_start, times)
    x, y, one = np.cos(theta), np.sin(theta), np.ones_like(theta)
    q = np.stack([x, y, x + one, y, x + 2.0 * one, y], axis=1)
    along = np.stack([-y, x, -y, x, -y, x], axis=1)
    signs = (1.0, 1.0, -1.0, 1.0)
    dq = [s * along * each[:, None] for s, each in zip(signs, change, strict=True)]
    dq[3] = dq[3] + q  # L = 1
    names = ('crank0.mass', 'coupler1.mass', 'gravity.acceleration.1', 'L')
    return ExactTangents('double_four_bar', times, names, q, tuple(dq))


def _times(duration: float) -> Floats:
    return np.asarray(np.linspace(0.0, duration, round(10 * duration) + 1), dtype=np.float64)


def _solved(
    acceleration: Acceleration,
    numbers: Sequence[float],
    start: tuple[float, float],
    by_start: Sequence[tuple[float, float]],
    times: Floats,
) -> tuple[Floats, Floats]:
    """θ (times,) and its derivatives by all numbers, and by the start that each changes."""
    count = len(by_start)

    def slope(at: int, given: Sequence[float]) -> float:
        moved = [x + (1j * _TINY if n == at else 0.0) for n, x in enumerate(given)]
        return float(np.imag(acceleration(*moved)) / _TINY)

    def rates(t: float, y: Floats) -> list[float]:
        theta, rate, *rest = y.tolist()
        given = (theta, rate, *numbers)
        by_theta, by_rate = slope(0, given), slope(1, given)
        found = [rate, float(np.real(acceleration(*given)))]
        for k in range(count):
            d, dd = rest[2 * k : 2 * k + 2]
            forced = slope(2 + k, given) if k < len(numbers) else 0.0
            found += [dd, by_theta * d + by_rate * dd + forced]
        return found

    y0 = np.concatenate([start, np.ravel(by_start)])
    found = solve_ivp(
        rates,
        (0.0, times[-1]),
        y0,
        method='DOP853',
        t_eval=times,
        rtol=1e-13,
        atol=1e-15,
        max_step=1e-2,
    ).y
    return found[0], found[2::2]

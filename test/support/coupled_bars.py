"""Two bars whose second angle is a multiple of the first: its motion by Lagrange's equation."""

from __future__ import annotations

import math

from scipy.integrate import solve_ivp

from alf_ros.arrays import Floats


def two_bars(ratio: float, duration: float) -> tuple[float, float]:
    """(one, two) rad by Lagrange's equation of the one coordinate θ; two = ratio θ."""
    L, m, I1, I2 = 1.0, (1.5, 0.8), 0.2 + 1.5 * 0.25, 0.1
    d = 0.3  # from A to the com of lower, along its bar, which is drawn raised by β
    beta = math.atan2(0.2, 0.7)

    def rate(_: float, y: Floats) -> list[float]:
        theta, w = y
        k, c = 1.0 + ratio, ratio * theta + beta  # of lower: angle k θ + β, against upper c
        inertia = I1 + m[1] * L**2 + k**2 * (I2 + m[1] * d**2) + 2 * k * m[1] * L * d * math.cos(c)
        # ½ dI/dθ w² + I ẇ = torque
        slope = -2.0 * k * ratio * m[1] * L * d * math.sin(c)
        torque = -9.81 * (m[0] * 0.5 + m[1] * L) * math.cos(theta)
        torque -= 9.81 * m[1] * d * k * math.cos(k * theta + beta)
        return [w, (torque - 0.5 * slope * w**2) / inertia]

    found = solve_ivp(rate, (0.0, duration), [0.0, 0.0], 'DOP853', rtol=1e-12, atol=1e-12)
    return found.y[0, -1], ratio * found.y[0, -1]

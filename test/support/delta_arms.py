"""The arms of a delta robot in closed form; also for complex steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from support.lagrange import Array

TURNS = 2.0 * np.pi * np.arange(3) / 3.0
OUT = np.array([np.cos(TURNS), np.sin(TURNS), 0.0 * TURNS]).T  # from the middle to each arm
ALONG = np.array([-np.sin(TURNS), np.cos(TURNS), 0.0 * TURNS]).T  # the axes of the motors
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class DeltaArms:
    """Radius of the base, lengths of arms and rods, radius of the plate, m."""

    base: float
    arm: float
    rod: float
    plate: float

    def angle(self, C: Array, k: int) -> Any:
        """θ of arm k below the horizontal, for the place of the platform: a cos, sin equation."""
        v = C - (self.base - self.plate) * OUT[k]
        out, down = v @ OUT[k], -v[2]
        # |v - a (cos θ out, -sin θ)|² = l²: out cos θ + down sin θ = c
        c = (v @ v + self.arm**2 - self.rod**2) / (2.0 * self.arm)
        size = np.sqrt(out * out + down * down)
        return np.arctan(down / out) + (np.pi if np.real(out) < 0.0 else 0.0) - np.arccos(c / size)

    def elbow(self, theta: Any, k: int) -> Array:
        """The end of arm k at θ."""
        return (self.base + self.arm * np.cos(theta)) * OUT[k] - self.arm * np.sin(theta) * UP

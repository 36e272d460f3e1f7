"""The general actuator of MuJoCo as a drive: gear · (gain u + b0 + b1 l + b2 l̇) on l = gear · x.

So k_p = -gear² b1, k_v = -gear² b2, and x* where the rest vanishes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from alf_ros.exchange.robot import Actuator


@dataclass(frozen=True)
class GeneralActuator:
    """An actuator of a joint or a tendon `on`, with its control.

    bias: b0, b1, b2. control_range, force_range: None where they do not limit.
    """

    name: str
    on: str
    gear: float
    gain: float
    bias: tuple[float, float, float]
    control: float
    control_range: tuple[float, float] | None = None
    force_range: tuple[float, float] | None = None
    on_tendon: bool = False

    @property
    def drive(self) -> Actuator | None:
        """None for one that pushes away from where it shall be, or that has no gear."""
        b0, b1, b2 = self.bias
        gear, force = self.gear, self.gain * self.control + b0
        if b1 > 0.0 or b2 > 0.0 or gear == 0.0:
            return None
        limits = []
        if self.force_range is not None:
            limits.append(abs(gear) * max(map(abs, self.force_range)))
        if self.control_range is not None and not b1 and not b2:
            largest = max(map(abs, self.control_range))
            limits.append(abs(gear) * (abs(self.gain) * largest + abs(b0)))
        limit = min(limits, default=math.inf)
        made = Actuator(self.name, self.on, limit=limit if math.isfinite(limit) else None)
        made = replace(made, on_tendon=self.on_tendon)
        if b1:
            place, stiff, damp = -force / (b1 * gear), -b1 * gear**2, -b2 * gear**2
            return replace(made, position=place, position_gain=stiff, velocity_gain=damp)
        if b2:
            return replace(made, velocity=-force / (b2 * gear), velocity_gain=-b2 * gear**2)
        return replace(made, effort=gear * force)

    @property
    def is_lopsided(self) -> bool:
        """Whether its force has a range that differs in the two directions."""
        ranges = [self.force_range, None if any(self.bias[1:]) else self.control_range]
        return any(each is not None and not np.isclose(-each[0], each[1]) for each in ranges)

    @property
    def takes_targets_beyond(self) -> bool:
        """Whether its range of controls bounds no target that is sent later."""
        bounds = self.control_range is not None and any(map(math.isfinite, self.control_range))
        return bounds and any(self.bias[1:])

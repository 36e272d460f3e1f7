"""Joint coordinates and their rates at any position of a model."""

from __future__ import annotations

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.instruments import Instruments
from alf_ros.simulation.reactions import ReactionsOf


class CoordinateReader:
    """Reads the joint coordinates of one model, in the order of `model.coordinate_names`."""

    def __init__(self, model: Model) -> None:
        self.model = model
        angles = model.system.angles.c.size // 2
        self._counted, self._turns = np.zeros((3, angles)), np.zeros(angles, dtype=np.int64)
        self._joints = Instruments(model, ReactionsOf(model)).coordinates
        self._is_angle = np.array([each.is_angle for each in model.coordinates], dtype=bool)

    def read(self, q: Floats, v: Floats) -> Floats:
        """(2, joint coordinates): values at q (blocks D, m), rad from -π to π, or m; and rates
        where q changes by v (blocks D)."""
        model, counted = self.model, self._counted
        self._turns[:] = 0
        kernel.counted_angles(model.unit, model.system.angles, q, v, self._turns, *counted)
        found = np.zeros((2, len(model.coordinates)))
        joints = self._joints
        kernel.joint_coordinates(model.unit, joints, q, v, counted[0], counted[1], *found)
        whole = 2.0 * np.pi * np.round(found[0] / (2.0 * np.pi))
        found[0] -= np.where(self._is_angle, whole, 0.0)
        return found

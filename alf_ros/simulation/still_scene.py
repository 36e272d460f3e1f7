"""The slopes of a scene by a parameter that leaves it as it is."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.input_values import NO_INPUTS, Inputs
from alf_ros.simulation.neighbour import ARRAYS, Neighbour


class StillScene:
    """Has the form of `ParameterSlopes`, with all slopes of the scene `here` zero."""

    value = 0.0
    changes_rows = False
    changes_drives = False
    acts = True

    def __init__(self, name: str, here: Neighbour) -> None:
        self.name, self._here = name, here
        self.arrays = {
            key: np.zeros_like(each) for key, each in zip(ARRAYS, here.arrays(), strict=True)
        }

    def params(self, inputs: Inputs = NO_INPUTS) -> Floats:
        """Zero, as many as the data of the effects with inputs held has numbers."""
        return np.zeros_like(self._here.effects(inputs).params)

    def by_effort(self, joint: str) -> Floats:
        """Zero, as many as the data of an effort on a joint has numbers."""
        return np.zeros_like(self._here.effort(joint))

    def placed(self, model: Model, t: float) -> tuple[Floats, Floats]:
        """Zero: no block is placed by it."""
        return np.zeros(model.q.size), np.zeros(model.q.size)

    def opening(self, model: Model, q: Floats, t: float) -> Floats:
        """(rows,) zero: no row changes."""
        return np.zeros(model.system.rows.alpha.size)

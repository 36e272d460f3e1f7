"""A direction of the state, which tangents follow like a number of the scene.

A tangent is linear in where it begins. The direction `state.0` begins where the restored
`State.tangents` says. The scene does not change with it.
"""

from __future__ import annotations

import re

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.applied import NO_INPUTS, Inputs
from alf_ros.simulation.neighbour import ARRAYS, Neighbour

_NAME = re.compile(r'state\.\d+')


def is_direction(name: str) -> bool:
    """Whether the name is of a direction of the state: `state.0`, `state.1`, …"""
    return _NAME.fullmatch(name) is not None


class StateDirection:
    """Has the form of `ParameterSlopes`, with all slopes of the scene `here` zero."""

    value = 0.0

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

    changes_drives = False
    acts = True

    def placed(self, model: Model, t: float) -> tuple[Floats, Floats]:
        """Zero: no block is placed by it."""
        return np.zeros(model.q.size), np.zeros(model.q.size)

    def opening(self, model: Model, q: Floats, t: float) -> Floats:
        """(rows,) zero: no row changes."""
        return np.zeros(model.system.rows.alpha.size)

"""How the data of the effects change with the numbers of a scene, while inputs change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.simulation.input_places import InputPlaces
from alf_ros.simulation.input_slopes import Slopes
from alf_ros.simulation.input_values import Inputs


class EffectSlopes:
    """The slopes of the data of the effects by K numbers.

    The data of a steady effort is linear in the effort. So with efforts that change often, their
    slopes are computed once.
    """

    def __init__(self, model: Model, slopes: Sequence[Slopes], places: InputPlaces) -> None:
        self._slopes, self._places = tuple(slopes), places
        self._alone = {each.name for each in model.coordinates if each.freedom.alone}
        self._still: tuple[Inputs, Floats] | None = None  # without efforts
        self._by_effort: dict[str, Floats] = {}

    def at(self, inputs: Inputs) -> Floats:
        """(K, numbers) with inputs held, and behind them the places."""
        efforts = inputs.efforts
        steady = {n: x for n, x in efforts.items() if isinstance(x, float) and n in self._alone}
        if len(steady) < len(efforts) or not self._slopes:
            return np.concatenate([self._all(inputs), self._places.slopes], axis=1)
        still = replace(inputs, efforts={})
        if self._still is None or self._still[0] != still:
            self._still = still, self._all(still)
        pushed = [effort * self._by(name) for name, effort in steady.items()]
        return np.concatenate([self._still[1], *pushed, self._places.slopes], axis=1)

    def _by(self, joint: str) -> Floats:
        """Of the data of an effort of 1 N m or 1 N on a joint."""
        if joint not in self._by_effort:
            self._by_effort[joint] = np.array([each.by_effort(joint) for each in self._slopes])
        return self._by_effort[joint]

    def _all(self, inputs: Inputs) -> Floats:
        found = [each.params(inputs) for each in self._slopes]
        return np.array(found) if found else np.zeros((0, 0))

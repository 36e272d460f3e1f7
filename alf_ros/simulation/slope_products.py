"""From derivatives by the arrays of a motion to derivatives by numbers of its scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array

from alf_ros.arrays import Floats, Integers
from alf_ros.model.compile import Model
from alf_ros.simulation.effect_slopes import EffectSlopes
from alf_ros.simulation.input_places import InputPlaces
from alf_ros.simulation.input_slopes import Slopes
from alf_ros.simulation.input_values import Inputs


def _matrix(rows: Sequence[Floats]) -> csr_array:
    """Of rows (columns,), most of which are zero."""
    return csr_array(np.array(rows) if rows else np.zeros((0, 0)))


class SlopeProducts:
    """The slopes of arrays by K numbers of a scene, times derivatives by these arrays.

    names: the arrays, as `ParameterSlopes.arrays` names them.
    """

    def __init__(self, model: Model, slopes: Sequence[Slopes], names: Sequence[str]) -> None:
        self._slopes, self.places = tuple(slopes), InputPlaces(model, slopes)
        self._effects = EffectSlopes(model, slopes, self.places)
        self._at: dict[str, slice] = {}
        self._size = 0
        for name in names if slopes else ():
            self._at[name] = slice(self._size, self._size + slopes[0].arrays[name].size)
            self._size = self._at[name].stop
        none = np.zeros(0)
        rows = [np.concatenate([none, *(s.arrays[n].ravel() for n in self._at)]) for s in slopes]
        self._arrays = _matrix(rows)
        self._params: tuple[Inputs, csr_array] | None = None

    def by_arrays(self, bars: Mapping[str, Floats]) -> Floats:
        """(K,) of ∂J/∂ arrays by their names; those that are absent are zero."""
        whole = np.zeros(self._size)
        for name, bar in bars.items():
            whole[self._at[name]] = bar.ravel()
        return np.asarray(self._arrays @ whole) if self._slopes else np.zeros(0)

    def by_params(self, inputs: Inputs, bar: Floats) -> Floats:
        """(K,) of ∂J/∂ the data of the effects, with inputs held."""
        return np.asarray(self._of_params(inputs) @ bar) if self._slopes else np.zeros(0)

    def changed_params(self, inputs: Inputs) -> Integers:
        """Which of the data of the effects the numbers change."""
        return np.asarray(self._of_params(inputs).indices)

    def changes(self, name: str) -> bool:
        """Whether a number changes an array."""
        return any(bool(each.arrays[name].any()) for each in self._slopes)

    def changes_fixed(self, n: int) -> bool:
        """Whether a number moves a fixed block, from number n of q on."""
        return any(bool(each.arrays['q'][n:].any()) for each in self._slopes)

    def _of_params(self, inputs: Inputs) -> csr_array:
        if self._params is None or self._params[0] != inputs:
            self._params = inputs, csr_array(self._effects.at(inputs))
        return self._params[1]

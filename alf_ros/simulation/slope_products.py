"""From derivatives by the arrays of a motion to derivatives by numbers of its scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.simulation.applied import Inputs
from alf_ros.simulation.tangent_following import Slopes


class _Matrix(NamedTuple):
    """(rows, columns), of which the numbers that are not zero are kept."""

    rows: int
    row: Integers
    column: Integers
    value: Floats

    @classmethod
    def of(cls, rows: Sequence[Floats]) -> _Matrix:
        """Of rows (columns,)."""
        columns = [np.flatnonzero(each) for each in rows]
        none = np.zeros(0, dtype=np.int64)
        return cls(
            len(rows),
            np.concatenate([none, *(np.full(each.size, k) for k, each in enumerate(columns))]),
            np.concatenate([none, *columns]),
            np.concatenate([np.zeros(0), *(v[c] for v, c in zip(rows, columns, strict=True))]),
        )

    def times(self, vector: Floats) -> Floats:
        """(rows,) the product with a vector (columns,)."""
        each = self.value * vector[self.column]
        summed: Floats = np.zeros(self.rows)
        np.add.at(summed, self.row, each)
        return summed


class SlopeProducts:
    """The slopes of arrays by K numbers of a scene, times derivatives by these arrays.

    names: the arrays, as `ParameterSlopes.arrays` names them.
    """

    def __init__(self, slopes: Sequence[Slopes], names: Sequence[str]) -> None:
        self._slopes = tuple(slopes)
        self._at: dict[str, slice] = {}
        self._size = 0
        for name in names if slopes else ():
            self._at[name] = slice(self._size, self._size + slopes[0].arrays[name].size)
            self._size = self._at[name].stop
        none = np.zeros(0)
        self._arrays = _Matrix.of(
            [np.concatenate([none, *(s.arrays[n].ravel() for n in self._at)]) for s in slopes]
        )
        self._params: tuple[Inputs, _Matrix] | None = None

    def by_arrays(self, bars: Mapping[str, Floats]) -> Floats:
        """(K,) of ∂J/∂ arrays by their names; those that are absent are zero."""
        whole = np.zeros(self._size)
        for name, bar in bars.items():
            whole[self._at[name]] = bar.ravel()
        return self._arrays.times(whole)

    def by_params(self, inputs: Inputs, bar: Floats) -> Floats:
        """(K,) of ∂J/∂ the data of the effects, with inputs held."""
        return self._of_params(inputs).times(bar)

    def changed_params(self, inputs: Inputs) -> Integers:
        """Which of the data of the effects the numbers change."""
        return self._of_params(inputs).column

    def changes_fixed(self, n: int) -> bool:
        """Whether a number moves a fixed block, from number n of q on."""
        return any(bool(each.arrays['q'][n:].any()) for each in self._slopes)

    def _of_params(self, inputs: Inputs) -> _Matrix:
        if self._params is None or self._params[0] != inputs:
            rows = [each.params(inputs) for each in self._slopes]
            self._params = inputs, _Matrix.of(rows)
        return self._params[1]

"""Which efforts of drives are one of many, because rows are redundant.

The effort of a drive is w·λ, with w the rates of all rows as its own block moves along. λ + Nᵀ z
balances for every z, with the left null vectors N of Φ_q: the effort is unique if N w = 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Work
from alf_ros.mechanism import Drive
from alf_ros.model.compile import Model

_LOST = 1e-3  # part of an effort that is left open from which on it is flagged


class OpenEfforts:
    """The efforts of the drives of a model at one instant."""

    def __init__(self, model: Model, work: Work, free: Floats) -> None:
        """`work`: q and Φ_q. `free` (k, rows): changes of λ that leave the motion as it is."""
        self._model, self._work = model, work
        self._root = np.sqrt(model.system.rows.alpha)
        self._free = np.linalg.qr((free / self._root).T)[0].T

    def of_drive(self, drive: Drive) -> NDArray[np.bool_]:
        """(1 or D,) of each number of its effort."""
        D = self._model.layout.dimension
        axes = range(D if drive.kind == 'point' else 1)
        return np.array([self._is_open(self._rates(drive, axis)) for axis in axes])

    def _rates(self, drive: Drive, axis: int) -> Floats:
        """(rows,) w."""
        model, work = self._model, self._work
        D, block = model.layout.dimension, model.layout.of_prescribed[drive.name]
        along = np.zeros((model.q.size // D, D))
        if drive.kind == 'angle':
            c, s = work.q.reshape(-1, D)[block][:2]
            along[block, :2] = -s, c
        else:
            along[block, axis] = 1.0
        rates = np.zeros(self._root.size)
        kernel.times_jacobian(model.unit, model.system.rows, work.g, work.g2, along.ravel(), rates)
        return rates

    def _is_open(self, rates: Floats) -> bool:
        whole = self._root * rates
        return bool(np.linalg.norm(self._free @ whole) > _LOST * np.linalg.norm(whole))

"""On which side of its dead points a mechanism is."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from alf_ros.arrays import Floats
from alf_ros.model.compile import Model
from alf_ros.studies.statics.sparse_rows import jacobian


class BranchSign:
    """The sign of the determinant of the rows of Φ_q that are independent at a position."""

    def __init__(self, model: Model, q: Floats, dependent_rows: int) -> None:
        self._model, self._rows = model, np.arange(len(model.row_names))
        if dependent_rows:
            pivots = scipy.linalg.qr(self._square(q).T, mode='r', pivoting=True)[1]
            self._rows = np.sort(pivots[: len(model.row_names) - dependent_rows])
        self._first = np.linalg.slogdet(self._square(q))[0]

    def at(self, q: Floats) -> int:
        """+1 as at the start, or -1; q (blocks D, m)."""
        return int(self._first * np.linalg.slogdet(self._square(q))[0])

    def _square(self, q: Floats) -> Floats:
        model = self._model
        scaled = jacobian(model, q)[:, : model.n].multiply(model.system.rows.scale[:, None])
        return np.asarray(scaled.toarray()[self._rows])

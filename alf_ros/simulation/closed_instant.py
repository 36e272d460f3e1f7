"""How a closed position and its velocities change with numbers of the scene, by dense matrices.

The tangents of a motion satisfy Φ_q δq = -∂Φ/∂θ and Φ_q δq̇ = -d(Φ_q) q̇ - ∂(Φ_q q̇)/∂θ. Here are
their smallest solutions, and the free directions Z, Φ_q Z = 0, which are perpendicular to these.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import DEPENDENT, Linearised
from alf_ros.simulation.differences import OFFSETS, slope
from alf_ros.simulation.displaced_scenes import Displaced

# part of a slope of Φ that redundant rows may leave open, and of the size: rounding
_OPEN, _ROUNDED = 1e-7, 1e-12


class ClosedInstant:
    """A model at t (s), q and q̇ (blocks D, m and m/s) that satisfy its rows."""

    def __init__(self, model: Model, t: float, q: Floats, qd: Floats) -> None:
        self._model, self._t, self._q, self._qd = model, t, q, qd
        rows, jacobian = model.system.rows, Linearised(model, q).jacobian
        self._of_places = model.row < rows.alpha.size - rows.velocity
        self._places = self._all = _Inverse(jacobian)
        if rows.velocity:
            self._places = _Inverse(jacobian[self._of_places])

    @property
    def rank(self) -> int:
        """Number of independent rows."""
        return self._all.rank

    @property
    def weakest(self) -> float:
        """The least singular value of the rows, of the largest: 0 where a motion is free."""
        return self._all.weakest

    @property
    def free(self) -> Floats:
        """(n, freedoms) Z of velocities."""
        return self._all.free

    @property
    def free_of_places(self) -> Floats:
        """(n, …) Z of positions, more where wheels roll."""
        return self._places.free

    @cached_property
    def carried(self) -> Floats:
        """(n, …) W: the least δq̇ for each of the free directions of positions."""
        found = np.zeros_like(self.free_of_places)
        for column, z in zip(found.T, self.free_of_places.T, strict=True):
            dq = np.zeros_like(self._q)
            dq[: self._model.n] = z
            column[:] = -self._all.times(self._scaled(_turned_rows(self._model, dq, self._qd)))
        return found

    def moved(self, around: Displaced) -> Floats:
        """p (blocks D): the smallest δq per unit of a number, with what the number does to the
        blocks that are given. Raises InputError if redundant rows do not hold beside this one."""
        name, step, scenes = around
        size = float(np.abs(self._q).max())
        placed = np.array([each.placed(self._t, self._q, self._qd)[0] for each in scenes])
        gaps = np.array([each.violation(at) for each, at in zip(scenes, placed, strict=True)])
        given = self._scaled(slope(gaps, step, name, 'a length', size**2))[self._of_places]
        p = slope(placed, step, name, 'a place')
        p[: self._model.n] = -self._places.times(given)
        most = _OPEN * np.abs(given).max(initial=0.0) + _ROUNDED * size / step
        if self._places.left(given) > most:
            raise InputError('no derivative: redundant rows hold only where it stays', key=name)
        return p

    def smallest(self, around: Displaced) -> tuple[Floats, Floats]:
        """p and p' (blocks D): the same, and the smallest δq̇. Raises InputError."""
        name, step, scenes = around
        p, rates, speeds = self.moved(around), [], []
        for offset, each in zip(OFFSETS, scenes, strict=True):
            q, qd = each.placed(self._t, self._q + offset * step * p, self._qd)
            rates.append(each.rate(q, qd))
            speeds.append(qd)
        faster = slope(np.array(speeds), step, name, 'a drive')
        size = float(np.abs(self._q).max() * np.abs(self._qd).max())
        given = self._scaled(slope(np.array(rates), step, name, 'a velocity', size))
        faster[: self._model.n] = -self._all.times(given)
        return p, faster

    def _scaled(self, of_rows: Floats) -> Floats:
        """(rows,) of the kernel -> in the order and scale of `Linearised`."""
        return np.asarray((of_rows * self._model.system.rows.scale)[self._model.row])


class _Inverse:
    """The pseudo-inverse of a matrix (rows, n)."""

    def __init__(self, matrix: Floats) -> None:
        U, s, Vt = np.linalg.svd(matrix)
        self.rank = int((s > DEPENDENT * s.max(initial=1e-300)).sum())
        self._U, self._s, self._Vt = U[:, : self.rank], s[: self.rank], Vt
        whole = s.size == matrix.shape[1] > 0
        self.weakest = float(s[-1] / s[0]) if whole and s[0] > 0.0 else 0.0

    @property
    def free(self) -> Floats:
        """(n, n - rank) orthonormal directions that the matrix takes to zero."""
        return np.asarray(self._Vt[self.rank :].T)

    def times(self, b: Floats) -> Floats:
        """(n,) the smallest x with matrix x = b (rows,), as far as there is one."""
        return np.asarray(self._Vt[: self.rank].T @ ((self._U.T @ b) / self._s))

    def left(self, b: Floats) -> float:
        """The largest part of b (rows,) that no x reaches."""
        return float(np.abs(b - self._U @ (self._U.T @ b)).max(initial=0.0))


def _turned_rows(model: Model, dq: Floats, qd: Floats) -> Floats:
    """(rows,) the change of Φ_q along dq, times q̇, in the order of the kernel."""
    unit, rows, D = model.unit, model.system.rows, model.layout.dimension
    g, g2, found = np.zeros(rows.i.size * D), np.zeros(rows.b.size), np.zeros(rows.alpha.size)
    kernel.jacobian(unit, rows, dq, g, g2)
    kernel.jacobian_rate(unit, rows, dq, g2)
    kernel.times_jacobian(unit, rows, g, g2, qd, found)
    return found

"""The derivatives of any quantity of an instant, by the free directions of its state and by
numbers of the scene.

Reactions, efforts and energies are functions y(θ, q, q̇) where a position is closed. The tangents
of a motion satisfy Φ_q δq = -∂Φ/∂θ and Φ_q δq̇ = -d(Φ_q) q̇ - ∂(Φ_q q̇)/∂θ, so that with the free
directions Z, Φ_q Z = 0,

    δq = p δθ + Z ε,   δq̇ = (p' δθ + W ε) + Z η

where p, p' and W are the smallest solutions. So y is differentiated along (1, p, p'), (0, Z, W)
and (0, 0, Z) alone: twice for each freedom, and once for each number. With the slopes s along
(0, Z, W) and r along (0, 0, Z), ∂y/∂q = Z s and ∂y/∂q̇ = Z r have the right product with all
tangents, because p, p' and W are perpendicular to Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import DEPENDENT, Linearised
from alf_ros.simulation.differences import OFFSETS, slope
from alf_ros.simulation.displaced_scenes import Displaced, DisplacedScenes
from alf_ros.simulation.named_quantity import NamedQuantity, slope_along
from alf_ros.simulation.sample import Sample
from alf_ros.studies.gradients.bars import Bars

# part of a slope of Φ that redundant rows may leave open, and of the size: rounding
_OPEN, _ROUNDED = 1e-7, 1e-12


@dataclass(frozen=True, eq=False)
class AlongFreeDirections:
    """The derivatives of a quantity, among the scenes `beside` the one of the run."""

    quantity: NamedQuantity
    beside: DisplacedScenes

    def add(self, sample: Sample, weights: Floats, to: Bars) -> None:
        """Add (components,) weights times the derivatives at a sample. Raises InputError in a
        singular position, and where the quantity is not smooth or not unique."""
        n, state = sample.model.n, sample.state
        self.quantity.check_unique(sample)
        instant = _Instant(sample, self.quantity.name)

        def along(around: Displaced, dq: Floats, dqd: Floats) -> float:
            of = self.quantity
            found = slope_along(of.read, of.turns, sample, around, dq, dqd, of.name)
            return float(weights @ found)

        still = np.zeros_like(state.q)
        for z, w in zip(instant.free_of_places.T, instant.carried.T, strict=True):
            dq, dqd = still.copy(), still.copy()
            dq[:n], dqd[:n] = z, w
            to.q[:n] += along(self.beside.along(state, dq, dqd), dq, dqd) * z
        for z in instant.free.T:
            dqd = still.copy()
            dqd[:n] = z
            to.qd[:n] += along(self.beside.along(state, still, dqd), still, dqd) * z
        for k in range(len(self.beside.names)):
            dq, dqd = instant.smallest(self.beside.around(k))
            to.numbers[k] += along(self.beside.moving(k, state, dq, dqd), dq, dqd)


class _Instant:
    """The rows of a mechanism at a sample, as dense matrices."""

    def __init__(self, sample: Sample, what: str) -> None:
        self._sample, self._model, rows = sample, sample.model, sample.model.system.rows
        jacobian = Linearised(sample.model, sample.state.q).jacobian
        places = sample.model.row < rows.alpha.size - rows.velocity
        self._places = _Inverse(jacobian[places])
        self._all = _Inverse(jacobian)
        self._of_places = places
        if self._all.rank < round(sample.model.system.rank):
            raise InputError(
                f'no gradient of {what}: a singular position at t = {sample.t:.6g} s', key='of'
            )

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
        state = self._sample.state
        found = np.zeros_like(self.free_of_places)
        for column, z in zip(found.T, self.free_of_places.T, strict=True):
            dq = np.zeros_like(state.q)
            dq[: self._model.n] = z
            column[:] = -self._all.times(self._scaled(_turned_rows(self._model, dq, state.qd)))
        return found

    def smallest(self, around: Displaced) -> tuple[Floats, Floats]:
        """p and p' (blocks D) of a number, with what it does to the blocks that are given. Raises
        InputError if redundant rows do not hold beside this scene."""
        (name, step, scenes), sample, n = around, self._sample, self._model.n
        q, qd = sample.state.q, sample.state.qd
        size, speed = float(np.abs(q).max()), float(np.abs(qd).max())
        placed = np.array([each.placed(sample.t, q, qd)[0] for each in scenes])
        gaps = np.array([each.violation(at) for each, at in zip(scenes, placed, strict=True)])
        given = self._scaled(slope(gaps, step, name, 'a length', size**2))[self._of_places]
        p = slope(placed, step, name, 'a place')
        p[:n] = -self._places.times(given)
        if self._places.left(given) > _OPEN * np.abs(given).max(
            initial=_ROUNDED / _OPEN * size / step
        ):
            raise InputError('no gradient: redundant rows hold only where it stays', key=name)
        rates, speeds = [], []
        for offset, each in zip(OFFSETS, scenes, strict=True):
            at, moving = each.placed(sample.t, q + offset * step * p, qd)
            rates.append(each.rate(at, moving))
            speeds.append(moving)
        faster = slope(np.array(speeds), step, name, 'a drive')
        given = self._scaled(slope(np.array(rates), step, name, 'a velocity', size * speed))
        faster[:n] = -self._all.times(given)
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

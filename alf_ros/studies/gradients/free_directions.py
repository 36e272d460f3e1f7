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

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.simulation.closed_instant import ClosedInstant
from alf_ros.simulation.differences import doubt, slope
from alf_ros.simulation.displaced_scenes import Displaced, DisplacedScenes
from alf_ros.simulation.named_quantity import NamedQuantity, changes_along, slope_by_push
from alf_ros.simulation.sample import Sample
from alf_ros.studies.gradients.bars import Bars

# times closer, where the quantity is not smooth as far as its first difference goes: beside a
# singular position states that are moved straight on leave the branch. Beside a kink of a force,
# such as a contact that begins, an energy has a difference further away too, which is off
_CLOSER = (1.0, 10.0, 100.0)
# part of the slope, and of the largest value a step, by which the orders of a sure one differ
_SURE, _ROUNDED = 1e-9, 1e-13


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
        instant = ClosedInstant(sample.model, sample.t, state.q, state.qd)
        if instant.rank < round(sample.model.system.rank):
            told = f'no gradient of {self.quantity.name}: a singular position'
            raise InputError(f'{told} at t = {sample.t:.6g} s', key='of')

        # an energy may be zero, and its parts are not
        beside_it = self.quantity.read_beside(sample)[1]
        what = f'{self.quantity.name} at t = {sample.t:.6g} s'

        def along(beside: Callable[..., Displaced], dq: Floats, dqd: Floats) -> float:
            of, least, best = self.quantity, np.inf, None
            for closer in _CLOSER:
                around = beside(state, closer * dq, closer * dqd)
                change, size = changes_along(of.read, of.turns, sample, around, dq, dqd, beside_it)
                try:
                    found = slope(change, around.step, around.name, what, size)
                except InputError as error:
                    refused = error
                    continue
                off = doubt(change, around.step)
                if off < least:
                    least, best = off, found
                if off <= _SURE * np.abs(found).max() + _ROUNDED * size / around.step:
                    break
            if best is None:
                raise refused
            return float(weights @ best)

        still = np.zeros_like(state.q)
        for z, w in zip(instant.free_of_places.T, instant.carried.T, strict=True):
            dq, dqd = still.copy(), still.copy()
            dq[:n], dqd[:n] = z, w
            to.q[:n] += along(self.beside.along, dq, dqd) * z
        for z in instant.free.T:
            dqd = still.copy()
            dqd[:n] = z
            to.qd[:n] += along(self.beside.along, still, dqd) * z
        for k in range(len(self.beside.names)):
            pushed = self.beside.pushed(k)
            if pushed is not None:
                by_push = slope_by_push(self.quantity.read, sample, pushed)
                to.numbers[k] += float(weights @ by_push)
                continue
            dq, dqd = instant.smallest(self.beside.around(k))
            to.numbers[k] += along(partial(self.beside.moving, k), dq, dqd)

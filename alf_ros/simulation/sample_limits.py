"""Values in a singular position, as limits along the motion.

The equations are singular there, the motion is not: values that are smooth along it are
interpolated from four places on either side, to eighth order, as stages are. Not everything is
smooth: multipliers and reactions may have a pole, and then no limit exists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.kernel import Forces, Method, Phase, Problem, Work
from alf_ros.kernel.sample_limits import evaluate_at_place, find_places
from alf_ros.model.compile import Model, allocate

_OFFSETS = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
# of the kernel's work, what samples read: with Φ_q and factor
_READ = ('q', 'qd', 'qdd', 'y', 'g', 'g2', 'gf', 'g2f', 'diagonal', 'off')
_SMOOTH = 1e-5  # part of the largest value, by which a place may be off what the others predict


@dataclass(frozen=True)
class Place:
    """A place beside the position: the kernel's work there, and the loads of friction (N)."""

    work: Work
    loads: Floats


class Limits:
    """The places around a singular position, and limits of what can be computed at each."""

    def __init__(self, places: list[Place], shift: float) -> None:
        """`shift` (in parts of the spacing): from the position of the sample to the middle."""
        self._places, self._at = places, _OFFSETS + shift

    @property
    def beside(self) -> Work:
        """The outermost place."""
        return self._places[-1].work

    def of(self, read: Callable[[Place], Floats]) -> Floats:
        """The limit of an array, component by component; NaN where there is none.

        There is one if the six outer places predict the two inner ones.
        """
        values = np.array([read(place) for place in self._places])
        limit = np.tensordot(lagrange_weights(self._at, 0.0), values, 1)
        outer = np.abs(_OFFSETS) > 1.0
        off = np.zeros_like(limit)
        for k in np.flatnonzero(~outer):
            predicted = np.tensordot(
                lagrange_weights(self._at[outer], self._at[k]), values[outer], 1
            )
            off = np.maximum(off, np.abs(predicted - values[k]))
        scale = np.abs(values).max(initial=0.0)
        return np.asarray(np.where(off <= _SMOOTH * scale, limit, np.nan))


def limits(
    model: Model,
    forces: Forces,
    method: Method,
    phase: Phase,
    near: Floats,
    t: float,
    part: float = 1.0,
) -> Limits | None:
    """Around a phase in a singular position, or closer to one than can be computed; None at a
    standstill, which tells no direction.

    near: (angles,) rad, what effects unwrap angles by; `part` of the usual spacing of the places.
    """
    work = allocate(model, model.system, 1)
    work.near[:] = near
    problem = Problem(model.unit, model.system, forces, method, work)
    if not find_places(problem, phase, t, part):
        return None
    places = []
    for k in range(_OFFSETS.size):
        if not evaluate_at_place(problem, t, k):
            return None
        there = allocate(model, model.system, 0)
        for name in _READ:
            getattr(there, name)[:] = getattr(work, name)
        places.append(Place(there, forces.bearings.loads.copy()))
    return Limits(places, float(work.place_shift[0]))


def lagrange_weights(at: Floats, x: float) -> Floats:
    """Of Lagrange's interpolation from `at` to x."""
    weights = np.ones(at.size)
    for i in range(at.size):
        others = np.delete(at, i)
        weights[i] = np.prod((x - others) / (at[i] - others))
    return weights

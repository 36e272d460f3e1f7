"""Starts of a search for positions of rest, a turn away from a start.

Forces such as the one of a torsion spring count turns: positions that look alike have other forces
a turn later. Beside each such angle the mechanism is turned about it, once either way, in small
steps along free motions, so that loops stay closed, gears stay in mesh, and all counts of turns
belong together. An angle that cannot come round, as the one of a rocker, gives no start.
"""

from __future__ import annotations

import math

import numpy as np

from alf_ros import effects, kernel
from alf_ros.arrays import Floats
from alf_ros.effects import contract
from alf_ros.errors import InputError
from alf_ros.kernel import Effects
from alf_ros.studies.statics.descent import moved
from alf_ros.studies.statics.instant import DENSE, Chosen, Instant, angles, forces

_STEP = 0.2  # rad, of a turn
_FAR = 0.1  # of the size, that a step moves at most
_STANDS = 0.01  # rad, a step that brings an angle forward by less ends a turn
_STEPS = 500  # of a turn at most


def counting(start: Instant) -> Chosen:
    """(angles,) whether forces are others a turn later, but for stops, which end a travel; of none
    in a mechanism too large for these starts."""
    found = np.zeros(start.turns.size, dtype=bool)
    if start.model.n > DENSE:
        return found
    each = start.loads.applied.each
    for effect in start.loads.applied.effects:
        at_rest = getattr(effects.load(effect.kind), 'at_rest', None)
        if at_rest is not None and at_rest(effect.parameters) == contract.STOP:
            continue
        part = each[effect.label].effects
        if _differ(start, part, np.ones(found.size)):
            found |= [_differ(start, part, one) for one in np.eye(found.size)]
    return found


def _differ(start: Instant, part: Effects, turns: Floats) -> bool:
    """Whether forces are others so many turns later (angles,)."""
    at, near = (start.t, start.q, start.qd), start.near
    here, later = (
        forces(part, *at, each, np.zeros(0)) for each in (near, near + 2.0 * math.pi * turns)
    )
    return not np.array_equal(here, later, equal_nan=True)


def turned_starts(start: Instant, which: Chosen) -> list[Instant]:
    """The start, turned once either way about each of these angles (angles,) that comes round."""
    both = [(k, sense) for k in np.flatnonzero(which).tolist() for sense in (1.0, -1.0)]
    found = (_turned(start, k, sense) for k, sense in both)
    return [each for each in found if each is not None]


def _turned(start: Instant, k: int, sense: float) -> Instant | None:
    here, most = start, _FAR * start.model.size
    begin = angles(start.model, start.q, start.turns)[0][k]
    left = 2.0 * math.pi
    for _ in range(_STEPS):
        try:
            along = _along(here, k)
            longest = float(np.abs(along).max(initial=0.0))
            step = min(left, _STEP, most / longest if longest > 0.0 else 0.0)
            here = moved(here, sense * step * along)
        except InputError:  # it cannot be closed further on, or moves something without mass
            return None
        now = angles(here.model, here.q, here.turns)[0][k]
        before, left = left, 2.0 * math.pi - sense * (now - begin)
        if left <= _STEP:
            return here
        if before - left < _STANDS:
            return None
    return None


def _along(here: Instant, k: int) -> Floats:
    """(n,) the free motion of least energy that turns angle k by a radian."""
    model, Z = here.model, here.velocity_directions
    rates, qd = np.zeros(Z.shape[1]), np.zeros_like(here.q)
    turned, spins, near = np.zeros((3, here.turns.size))
    for n, direction in enumerate(Z.T):
        qd[: model.n] = direction
        of = model.unit, model.system.angles, here.q, qd, here.turns
        kernel.counted_angles(*of, turned, spins, near)
        rates[n] = spins[k]
    square = float(rates @ rates)
    return np.asarray(Z @ rates / square if square > 0.0 else np.zeros(model.n))

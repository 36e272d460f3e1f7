"""δQ of a displacement δq or of a velocity δq̇ at an instant.

Forces for dual numbers give it exact to rounding, on the side of a kink on which the instant lies:
a stiff contact is often no deeper than a micrometre. Differences are taken for an effect without
such a force, for friction that reactions load, and where the derivative is infinite.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from alf_ros import effects as registry
from alf_ros import kernel
from alf_ros.arrays import Addresses, Floats, Integers
from alf_ros.kernel import Effects, ForceDirection
from alf_ros.kernel.numba_ext.plain import PLAIN
from alf_ros.studies.statics.difference_slopes import slope_at_zero

STEPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of a typical length
# of a typical length a second: friction turns in 1e-3 m/s
RATES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

_BENT = 1e-2  # part of a change of force; 1 in a kink, and next to nothing where the law is smooth
_FARTHER = (10.0, 100.0)  # times the length within which a kink is looked for
# times the bend at the first of them, at the second one: 10 to 11 in a kink; 10^p of a force δ^p,
# which begins without a slope
_GROWN = 11.5
_ROUNDED = 64.0 * float(np.finfo(float).eps)

Force = Callable[[Floats, Floats], Floats]  # q, q̇ -> Q, all (blocks D,)


def dual_forces(kinds: Sequence[str]) -> Addresses:
    """(effects,) the addresses of the forces of kinds of effects for dual numbers; 0 of a kind
    that has none."""
    found = np.zeros(len(kinds), dtype=np.uint64)
    if PLAIN:
        return found
    # it teaches numba new types: only where somebody asks
    from alf_ros.effects.contract.dual_force import dual_force

    for e, kind in enumerate(kinds):
        try:
            found[e] = dual_force(registry.load(kind).force._pyfunc).address
        except TypeError:
            continue
    return found


class ForceChange:
    """δQ of effects, with the addresses of their forces for dual numbers, at t (s), q, q̇
    (blocks D, m, m/s), near (angles,) and rubbing (loads,), N."""

    def __init__(
        self,
        effects: Effects,
        duals: Addresses,
        t: float,
        q: Floats,
        qd: Floats,
        near: Floats,
        rubbing: Floats,
    ) -> None:
        self._effects = effects
        self._duals = duals
        self._others = np.flatnonzero(duals == 0)
        self._at = t, q, qd, near
        self._rubbing = rubbing

    def of(self, dq: Floats, dqd: Floats, steps: Sequence[float]) -> Floats:
        """δQ (blocks D,); `steps`: lengths of differences, from the longest."""
        found = self._exact(dq, dqd)
        if not np.isfinite(found).all():
            return slope_at_zero(self._along(self._whole, dq, dqd), steps).slopes
        if self._others.size or self._rubbing.size:
            found += slope_at_zero(self._along(self._rest, dq, dqd), steps).slopes
        return found

    def has_kink(self, directions: Floats, length: float, *, in_speed: bool = False) -> bool:
        """Whether the slopes of forces jump within a length (m) of here along one of the
        directions (k, n), so that their derivative belongs to one side; `in_speed`: of velocities,
        within m/s."""
        for force, here, bent in self._bends(directions, length, in_speed):
            near, far = (np.abs(force(h) - 2.0 * here + force(-h)) for h in _FARTHER)
            if (far[bent] <= _GROWN * near[bent]).any():
                return True
        return False

    def bends(self, directions: Floats, length: float) -> bool:
        """Whether forces have a kink there, or begin without a slope: differences over such a
        length are no slopes."""
        return any(True for _ in self._bends(directions, length, False))

    def _bends(
        self, directions: Floats, length: float, in_speed: bool
    ) -> Iterator[tuple[Callable[[float], Floats], Floats, NDArray[np.bool_]]]:
        """Along directions in which forces bend: the forces at a step, here, and which bend."""
        _, q, _, _ = self._at
        for direction in directions:
            along, still = np.zeros_like(q), np.zeros_like(q)
            along[: direction.size] = direction * (length / max(np.abs(direction).max(), 1e-300))
            change = (still, along) if in_speed else (along, still)
            force = self._along(self._whole, *change)
            here, ahead, behind = force(0.0), force(1.0), force(-1.0)
            rounding = _ROUNDED * float(np.abs(here).max(initial=0.0))
            least = _BENT * float(np.abs(ahead - behind).max(initial=0.0)) + rounding
            bent = np.abs(ahead - 2.0 * here + behind) > least
            if bent.any():
                yield force, here, bent

    def _exact(self, dq: Floats, dqd: Floats) -> Floats:
        t, q, qd, near = self._at
        same, Q, dQ = np.zeros(self._effects.params.size), np.zeros_like(q), np.zeros_like(q)
        along = ForceDirection(force=self._duals, dq=dq, dqd=dqd, dparams=same, Q=Q, dQ=dQ)
        kernel.force_change(self._effects, along, t, q, qd, near)
        return dQ

    def _along(self, force: Force, dq: Floats, dqd: Floats) -> Callable[[float], Floats]:
        """Q of a step h along the direction."""
        _, q, qd, _ = self._at
        return lambda h: force(q + h * dq, qd + h * dqd)

    def _rest(self, q: Floats, qd: Floats) -> Floats:
        """The forces without exact change."""
        return self._summed(q, qd, self._others)

    def _whole(self, q: Floats, qd: Floats) -> Floats:
        return self._summed(q, qd, np.arange(self._duals.size))

    def _summed(self, q: Floats, qd: Floats, chosen: Integers) -> Floats:
        t, _, _, near = self._at
        Q = np.zeros_like(q)
        kernel.chosen_forces(self._effects, chosen, t, q, qd, near, Q)
        if self._rubbing.size:
            kernel.add_friction(self._effects, t, q, qd, near, self._rubbing, Q)
        return Q

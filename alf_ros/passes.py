"""Passes through singular positions, as events.

After each step the kernel notes tr(M A⁻¹), from which the distance σ to a singular position
follows. Through one it falls to zero and rises again on the other side: where the signed values of
three steps lie along a line the zero between them is a pass. A mechanism that comes near and
turns back rounds its minimum instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Phase, Watch
from alf_ros.mechanism import GROUND
from alf_ros.model import Model, allocate
from alf_ros.rank import distance
from alf_ros.rows import joint_rows, rigidity

_MOST = 1000  # steps that are watched in one call of the kernel
_NEAR = 0.5  # distance above which nothing is looked at
_BENT = 0.3  # second difference over the first, from which on a minimum is no pass
_TAKES_PART = 0.02  # share of a row in the dependency, from which on it is named


@dataclass(frozen=True)
class Pass:
    """A pass through a singular position.

    `t` (s); `distance` at the nearest step; `joints` that join the bodies whose constraints become
    dependent there; `energy_before` and `energy_after` (J) at the steps around it.
    """

    t: float
    distance: float
    joints: tuple[str, ...]
    energy_before: float
    energy_after: float


# phase, first step, steps, watch -> result, steps taken
Advance = Callable[[Phase, int, int, Watch | None], tuple[int, int]]


class Watcher:
    """Steps, and finds the passes on the way."""

    def __init__(self, model: Model, dependent: int, ordinary: Floats, h: float) -> None:
        """`dependent` rows at ordinary positions, of which `ordinary` (blocks D, m) is one; h (s):
        the step of the simulation."""
        self.passes: list[Pass] = []
        self._model, self._h = model, h
        D, blocks = model.layout.dimension, model.system.pattern.row.size
        self._watch = Watch(
            trace=np.zeros(_MOST),
            energy=np.zeros(_MOST),
            Z=np.zeros(model.n * D),
            Zo=np.zeros(blocks * D * D),
        )
        self._independent = len(model.row_names) - dependent
        self._ordinary = _dependency(model, ordinary)
        self.restart()

    def restart(self) -> None:
        """Forget all passes: the simulation goes on from another state."""
        self.passes.clear()
        # times, distances and energies of the last two steps: a pass is seen from the one after
        self._t: Floats = np.zeros(0)
        self._sigma: Floats = np.zeros(0)
        self._energy: Floats = np.zeros(0)

    def step(self, phase: Phase, first: int, n: int, advance: Advance) -> tuple[int, int]:
        """n steps from number `first`; returns (result, steps taken)."""
        result, taken = kernel.OK, 0
        while taken < n and result == kernel.OK:
            before = copy(phase)
            result, more = advance(phase, first + taken, min(_MOST, n - taken), self._watch)
            for k, event in self._found(first + taken, more):
                there = copy(before)
                if k >= 0:  # once more, up to the step that is nearest
                    advance(there, first + taken, k + 1, None)
                joints = _joints(self._model, _dependency(self._model, there.q) - self._ordinary)
                self.passes.append(replace(event, joints=joints))
            taken += more
        return result, taken

    def _found(self, first: int, taken: int) -> list[tuple[int, Pass]]:
        """(number of the nearest step in this call, the pass); -1 for the last one before it."""
        watch, kept = self._watch, self._t.size
        missing = self._independent - (self._model.n - watch.trace[:taken])
        t = np.concatenate([self._t, (first + 1 + np.arange(taken)) * self._h])
        sigma = np.concatenate([self._sigma, distance(missing, self._model.penalty)])
        energy = np.concatenate([self._energy, watch.energy[:taken]])
        found = []
        for k in range(1, t.size - 1):
            if sigma[k] < _NEAR and sigma[k - 1] > sigma[k] <= sigma[k + 1]:
                found_at = zero(t[k - 1 : k + 2], sigma[k - 1 : k + 2])
                if found_at is not None:
                    around = float(energy[k - 1]), float(energy[k + 1])
                    found.append((k - kept, Pass(found_at, float(sigma[k]), (), *around)))
        self._t, self._sigma, self._energy = t[-2:], sigma[-2:], energy[-2:]
        return found


def copy(phase: Phase) -> Phase:
    """The same in arrays of its own."""
    turns, pace, works = phase.turns.copy(), phase.pace.copy(), phase.works.copy()
    return Phase(phase.q.copy(), phase.qd.copy(), turns, pace, works, phase.loads.copy())


def zero(t: Floats, sigma: Floats) -> float | None:
    """Where the signed distance is zero, by a parabola through three steps, if it is anywhere."""
    found, least = None, _BENT
    for sign in (-1.0, 1.0):
        before, middle, after = sigma * [-1.0, sign, 1.0]
        slope = (after - before) / (t[2] - t[0])
        bend = (after - middle) / (t[2] - t[1]) - (middle - before) / (t[1] - t[0])
        if abs(bend) <= least * slope:
            least = abs(bend) / slope
            # inverse interpolation: t as the parabola of the distance
            found = float(np.polyfit([before, middle, after], t - t[1], 2)[2] + t[1])
    return found


def _dependency(model: Model, q: Floats) -> Floats:
    """(rows,) in the kernel's order: 1 - α_r Φ_r A⁻¹ Φ_rᵀ at q (blocks D, m): the part of a row
    that others imply."""
    rows, unit, work = model.system.rows, model.unit, allocate(model, model.system, 0)
    kernel.linearise(unit, model.system, work, q)
    share = np.ones(rows.alpha.size)
    y, x, rate = np.zeros(rows.alpha.size), np.zeros(model.q.size), np.zeros(rows.alpha.size)
    for r in range(share.size):
        y[:], x[:] = 0.0, 0.0
        y[r] = rows.alpha[r]
        kernel.add_transposed(unit, rows, work.g, work.g2, y, x)
        kernel.solve(unit, model.system.pattern, work.diagonal, work.off, x)
        x[model.n :] = 0.0
        kernel.times_jacobian(unit, rows, work.g, work.g2, x, rate)
        share[r] -= rate[r]
    return share


def _joints(model: Model, share: Floats) -> tuple[str, ...]:
    """The joints that join the bodies of which a row takes part in the dependency."""
    takes_part = share[model.row] > _TAKES_PART * share.sum()
    names = {model.row_names[n] for n in np.flatnonzero(takes_part)}
    mechanism, layout = model.mechanism, model.layout
    bodies = {
        body.name
        for body in mechanism.bodies
        if any(row.name in names for row in rigidity(body, layout))
    }
    return tuple(
        joint.name
        for joint in mechanism.joints
        if any(row.name in names for row in joint_rows(joint, layout))
        or {joint.parent, joint.child} <= bodies | {GROUND}
    )

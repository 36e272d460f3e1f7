"""Passes through singular positions, as events.

A mode of Φ_q with singular value σ and vectors z (of rows) and u (of motions) can be followed with
a sign: σ = z·B u. Through a singular position it goes linearly, from plus to minus. Two positions
thus show whether a mode vanishes between them: z·B u with the vectors of one and the B of the
other has the other sign. A mode that only comes near and turns back keeps its sign.

After each step the kernel follows the two softest modes, and stops where their σ changes much.
Then the step is examined here. Parts of it are computed separately, as many as needed until each
part shows either that no mode changes its sign or where one does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel import Modes, Phase, Status, Watch, Work
from alf_ros.kernel.softest_modes import STIFF
from alf_ros.mechanism import GROUND
from alf_ros.model.compile import Model, allocate
from alf_ros.model.constraints.rows import joint_rows, rigidity
from alf_ros.model.softest_modes import KNOWN, NIL, ROUNDS, begun, found, restart

FOLLOWED = 2  # modes
_SAME = 0.5  # by which σ of a mode, seen from two places, may differ of itself
_KEPT = 0.2  # part of σ that stays of a mode which is not about to vanish
_TURN = 0.7  # rad that rows may turn between places that are compared
_HALVED, _CUT = 10, 30  # parts in parts, while nothing is clear, and in all
_FINE = 1e-6  # of a step: where two places so near differ in sign, that is when
_BESIDE = 1e-3  # of a step: places beside one that has no sign
_TOGETHER = 1e-2  # of a step: modes that vanish so soon after one another do so at one position
_DIP = np.linspace(0.0, 1.0, 33)
_TAKES_PART = 0.02  # share of a row in the dependency, from which on it is named


@dataclass(frozen=True)
class Pass:
    """A pass through a singular position.

    `t` (s); `distance` σ where the nearer of the steps around it ends; `joints` that join the
    bodies whose constraints become dependent there; `energy_before` and `energy_after` (J) at the
    steps around it; q (blocks D, m) there, and the combination of rows (rows,) that vanishes, both
    in the kernel's order.
    """

    t: float
    distance: float
    joints: tuple[str, ...]
    energy_before: float
    energy_after: float
    q: Floats = field(repr=False, compare=False)
    lost: Floats = field(repr=False, compare=False)


@dataclass(frozen=True, eq=False)
class ModesAt:
    """The modes at t (s) and q (blocks D, m), the velocities q̇ too if they are known."""

    t: float
    phase: Phase
    modes: Modes

    @property
    def sigma(self) -> float:
        """The smallest singular value of the modes."""
        return float(self.modes.sigma[0])


class ModeComparison:
    """Information from the modes of two successive positions about the motion between them."""

    def __init__(self, model: Model, work: Work, a: ModesAt, b: ModesAt, moving: bool) -> None:
        """`moving`: the places know their velocities."""

        def seen(of: ModesAt, at: Modes) -> list[float]:
            unit, system = model.unit, model.system
            count = max(1, int((of.modes.sigma < STIFF).sum()))
            return [
                kernel.carried_over(unit, system, work, of.modes, at.g, at.g2, i)
                for i in range(count)
            ]

        self._a, self._b = a, b
        ahead, back = seen(a, b.modes), seen(b, a.modes)
        first, others = (ahead, back) if a.sigma <= b.sigma else (back, ahead)
        self.changes_sign = first[0] < 0.0
        self._same = abs(ahead[0] * back[0] - 1.0) <= _SAME
        self._clear = self._same and min(first[1:] + others[1:], default=1.0) > _KEPT
        if moving:
            rates = [_rates(model, work, place) for place in (a, b)]
            dt = b.t - a.t
            if dt * max(rate for rate, _ in rates) > _TURN:
                self._same = self._clear = False
            slopes = [dt * slope * x.sigma for (_, slope), x in zip(rates, (a, b), strict=True)]
            self._clear = self._clear and _cubic(a.sigma, b.sigma, *slopes).min() > 0.0

    @property
    def passes(self) -> bool:
        """The softest mode vanishes on the way."""
        return self._same and self.changes_sign

    @property
    def is_clear(self) -> bool:
        """No mode vanishes on the way."""
        return self._clear and not self.changes_sign

    @property
    def t(self) -> float:
        """When it vanishes, s, if it goes linearly."""
        a, b = self._a, self._b
        return a.t + (b.t - a.t) * a.sigma / (a.sigma + b.sigma)


def _rates(model: Model, work: Work, place: ModesAt) -> tuple[float, float]:
    """1/s: how fast the rows turn, at most, and σ̇ / σ of the softest mode."""
    unit, system, modes = model.unit, model.system, place.modes
    gd, g2d = np.zeros_like(modes.g), np.zeros_like(modes.g2)
    rate = kernel.turning(unit, system, g2d, place.phase.qd)
    blocks = place.phase.qd.reshape(-1, model.layout.dimension)
    gd[:] = (blocks[system.rows.i] - blocks[system.rows.j]).ravel()
    return rate, kernel.carried_over(unit, system, work, modes, gd, g2d, 0)


def _cubic(a: float, b: float, slope_a: float, slope_b: float) -> Floats:
    """Between 0 and 1, with values and slopes at the ends."""
    x = _DIP
    return np.asarray(
        (1 + 2 * x) * (1 - x) ** 2 * a
        + x**2 * (3 - 2 * x) * b
        + x * (1 - x) ** 2 * slope_a
        - x**2 * (1 - x) * slope_b
    )


# steps and watch -> result: steps of the run, fewer if one is to be looked at
Advance = Callable[[int, Watch | None], Status]
# phase, start (s), h (s) -> result, of one step that is no part of the run
Aside = Callable[[Phase, float, float], Status]
Energy = Callable[[float, Phase], float]


class Watcher:
    """Steps, and finds the passes on the way."""

    def __init__(
        self,
        model: Model,
        dependent: int,
        ordinary: Floats,
        h: float,
        advance: Advance,
        aside: Aside,
        energy: Energy,
    ) -> None:
        """`dependent` rows at ordinary positions, of which `ordinary` (blocks D, m) is one; h (s):
        the step of the simulation; `advance` and `aside` take steps, `energy` is that (J) at t (s)
        and a phase."""
        self.passes: list[Pass] = []
        self._model, self._h, self._redundant = model, h, dependent
        self._advance, self._step_aside, self._energy = advance, aside, energy
        self._work = allocate(model, model.system, 0)
        self._ordinary = _dependency(model, ordinary)
        self._watch: Watch | None = None
        self._modes = begun(model, dependent, FOLLOWED)
        self.restart()

    def restart(self) -> None:
        """Forget all passes: the simulation continues from another state."""
        self.passes.clear()
        self._known = False
        # the last step whose end has a σ without sign: where it began, and a place before its end
        self._open: tuple[ModesAt, ModesAt] | None = None
        self._nil: float | None = None  # s, when σ was least since then

    @property
    def memory(self) -> dict[str, Any]:
        """Data of a copy that continues in the same way, in arrays of its own."""
        watch = copy(self._watch) if self._watch is not None else None
        return {
            'passes': tuple(self.passes),
            'known': self._known,
            'watch': watch,
            'open': self._open,
            'nil': self._nil,
        }

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Continue from the memory of another watcher of the same run."""
        self.passes[:] = memory['passes']
        self._known, self._open, self._nil = (memory[name] for name in ('known', 'open', 'nil'))
        self._watch = memory['watch']
        if self._watch is not None:
            self._modes = self._watch.modes

    def step(self, phase: Phase, n: int) -> Status:
        """n steps of a run, which changes `phase`, its present; fewer if one fails."""
        if self._modes is None:  # nothing can depend on anything
            return self._advance(n, None)
        self.finish()
        if not self._known:
            self._begin(phase, int(phase.step[0]) * self._h)
        status, last = Status.OK, int(phase.step[0]) + n
        while phase.step[0] < last and status == Status.OK:
            status = self._advance(last - int(phase.step[0]), self._watch)
            self.finish()
        return status

    def finish(self) -> None:
        """Look at the last step, if it is to be looked at: again where that was interrupted."""
        watch = self._watch
        if self._known and watch is not None and watch.look[0]:
            self.passes += self._look_at(watch)
            watch.look[0] = 0

    def _begin(self, phase: Phase, t: float) -> None:
        model, modes = self._model, self._modes
        assert modes is not None
        if self._watch is None:
            self._watch = Watch(
                modes=modes,
                quiet=np.zeros(1, dtype=np.int64),
                look=np.zeros(1, dtype=np.int64),
                t=np.zeros(2),
                rate=np.zeros(1),
                before=copy(phase),
                after=copy(phase),
                g2d=np.zeros_like(modes.g2),
            )
        watch = self._watch
        restart(modes)
        for name in ('q', 'qd', 'turns', 'pace', 'works'):
            getattr(watch.after, name)[:] = getattr(phase, name)
        watch.quiet[0], watch.look[0], watch.t[1] = 0, 0, t
        watch.rate[0] = kernel.turning(model.unit, model.system, watch.g2d, phase.qd)
        if kernel.linearise(model.unit, model.system, self._work, phase.q):
            kernel.softest(model.unit, model.system, self._work, modes, ROUNDS, KNOWN)
        self._known = True

    def _look_at(self, watch: Watch) -> list[Pass]:
        """The passes in the last step, in which a singular position may have been passed."""
        before, after = float(watch.t[0]), float(watch.t[1])
        a, b = self._place(before, watch.before), self._place(after, watch.after)
        if a is None or b is None:
            return []
        if b.sigma < NIL or a.sigma < NIL:
            return self._across(a, b)
        return self._between(a, b, a, b)

    def _between(self, a: ModesAt, b: ModesAt, start: ModesAt, end: ModesAt) -> list[Pass]:
        """The passes between two places, of the step from a to b."""
        last, passes = -np.inf, []
        for t in self._search(start, end, _HALVED, _CUT):
            if t - last > _TOGETHER * self._h:
                passes.append(self._found(t, a, b))
            last = t
        return passes

    def _across(self, a: ModesAt, b: ModesAt) -> list[Pass]:
        """From or to places without a sign. Places beside them, within the step, have one: the
        mechanism may turn back in the step, and pass twice."""
        beside = _TOGETHER * (b.t - a.t)
        start = a if a.sigma >= NIL else self._with_sign(a, a.t + beside)
        end = b if b.sigma >= NIL else self._with_sign(a, b.t - beside)
        if a.sigma < NIL and b.sigma < NIL and (start is None or end is None):  # it stays there
            return []
        start, end = start or b, end or a  # too slow to have a sign soon
        passes = []
        if a.sigma < NIL and self._open is not None and self._nil is not None:
            before, near = self._open
            if ModeComparison(self._model, self._work, near, start, moving=False).changes_sign:
                passes = [self._found(self._nil, before, b)]
        if start.t < end.t:
            passes += self._between(a, b, start, end)
        self._open, self._nil = ((a, end), b.t) if b.sigma < NIL else (None, None)
        return passes

    def _with_sign(self, a: ModesAt, t: float) -> ModesAt | None:
        """`_aside`, if σ has a sign there."""
        found = self._aside(a, t)
        return None if found is None or found.sigma < NIL else found

    def _search(
        self, a: ModesAt, b: ModesAt, halved: int, cut: int, slow: bool = False
    ) -> list[float]:
        """When modes vanish between two places, s. `slow`: the last cut, where σ as a linear
        function vanishes, left more than half."""
        told = ModeComparison(self._model, self._work, a, b, moving=True)
        if told.is_clear:
            return []
        fine = b.t - a.t <= _FINE * self._h
        if fine or (told.passes and cut == 0) or (not told.passes and halved == 0):
            return [told.t] if told.changes_sign else []
        t = told.t if told.passes and not slow else 0.5 * (a.t + b.t)
        edge = 0.1 * _FINE * self._h
        middle = self._aside(a, min(max(t, a.t + edge), b.t - edge))
        if middle is not None and middle.sigma < NIL:
            if told.passes:
                return [self._vanishing(a, b, middle)]
            middle = self._aside(a, a.t + 0.37 * (b.t - a.t))
        if middle is None or middle.sigma < NIL:
            return [told.t] if told.changes_sign else []
        halved -= not told.passes
        cut -= not slow
        whole = b.t - a.t
        return [
            t
            for c, d in ((a, middle), (middle, b))
            for t in self._search(c, d, halved, cut, told.passes and d.t - c.t > 0.5 * whole)
        ]

    def _vanishing(self, a: ModesAt, b: ModesAt, middle: ModesAt) -> float:
        """When a mode vanishes near a place without a sign, s: from places on both sides."""
        away = _BESIDE * self._h
        before = self._with_sign(a, max(middle.t - away, 0.5 * (a.t + middle.t)))
        after = self._with_sign(a, min(middle.t + away, 0.5 * (b.t + middle.t)))
        if before is None or after is None:
            return middle.t
        told = ModeComparison(self._model, self._work, before, after, moving=True)
        return told.t if told.changes_sign else middle.t

    def _aside(self, a: ModesAt, t: float) -> ModesAt | None:
        """Where a step from a leads until t (s); None if it fails."""
        phase = copy(a.phase)
        result = self._step_aside(phase, a.t, t - a.t)
        return self._place(t, phase) if result == Status.OK else None

    def _place(self, t: float, phase: Phase) -> ModesAt | None:
        return place(self._model, self._work, self._redundant, t, copy(phase))

    def _found(self, t: float, a: ModesAt, b: ModesAt) -> Pass:
        there = (self._aside(a, t) if t > a.t else a) or a
        q, modes = there.phase.q, there.modes
        joints = _joints(self._model, _dependency(self._model, q) - self._ordinary)
        energies = self._energy(a.t, a.phase), self._energy(b.t, b.phase)
        lost = modes.root * modes.z.reshape(-1, modes.root.size)[0]
        return Pass(t, min(a.sigma, b.sigma), joints, *energies, q.copy(), lost)


def place(model: Model, work: Work, redundant: int, t: float, phase: Phase) -> ModesAt | None:
    """The modes of a phase; None if A has no factor there."""
    if not kernel.linearise(model.unit, model.system, work, phase.q):
        return None
    modes = found(model, work, redundant)
    return None if modes is None else ModesAt(t, phase, modes)


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
    takes_part = share[model.row] > _TAKES_PART * min(1.0, share.sum())
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

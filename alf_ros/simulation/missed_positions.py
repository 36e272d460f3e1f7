"""Singular positions that a motion comes near to and misses: by how much, and for what reason."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from alf_ros import kernel
from alf_ros.arrays import Floats
from alf_ros.kernel.interpolated_stages import DRIFT
from alf_ros.model import singular_start
from alf_ros.model.compile import Model, allocate
from alf_ros.model.consistency import freed
from alf_ros.model.free_walk import PENALTY, Walk, carried
from alf_ros.model.ordinary_positions import ordinary
from alf_ros.model.softest_modes import found
from alf_ros.simulation.resolution import LENGTHS, MOTION, Judged, Resolution
from alf_ros.simulation.start import Start

_LOOKED_AT = 600  # coordinates of mechanisms that are searched for what lengths miss
_MEANT = 1e-3  # of the size: what misses a position by more is not why a step fails
_ACROSS = 0.25  # of a step that leaps over a turn: steps that follow it are shorter
_PLAIN = 1e-6  # of the size: lengths that differ by more are followed to the other branch
_SLOW = 0.01  # part of the velocity, below which a branch is not told by it
_BESIDE = 5e-3  # distance to a singular position that stages take for near at all speeds


class MissedPositions:
    """Singular positions that motions from `start` miss. `tolerance`: of adaptive steps; 0 of
    fixed ones, which may leap over a position to which no stage comes near."""

    def __init__(self, start: Start, tolerance: float) -> None:
        self._start, self._model, self._tolerance = start, start.model, tolerance

    @cached_property
    def _freed(self) -> tuple[Model, Floats, int]:
        """(model, q, dependent rows) of the start without drives, as `consistency.freed`."""
        return freed(self._model, self._start.q, self._start.dependent_rows)

    @cached_property
    def reason(self) -> str:
        """With one freedom only lengths can miss a singular position; with several, the motion."""
        model, _, dependent_rows = self._freed
        return LENGTHS if model.n - (len(model.row_names) - dependent_rows) == 1 else MOTION

    @cached_property
    def on_the_way(self) -> float:
        """By how much (m) lengths miss singular positions on the way of the mechanism from where
        the scene starts. The first access takes some tenths of a second."""
        return self._walked(self._start.q, None)

    @cached_property
    def _examined(self) -> bool:
        """Whether the way of the mechanism can be followed without its motion."""
        return self._model.n <= _LOOKED_AT and self.reason == LENGTHS

    def _walked(self, q: Floats, qd: Floats | None) -> float:
        """As `Walk.missed` from q (blocks D, m), near by along q̇ (blocks D, m/s), all the way
        without q̇; 0 for mechanisms that are not examined."""
        if not self._examined:
            return 0.0
        model, _, dependent_rows = self._freed
        walk, layout = Walk(model.with_penalty(PENALTY), dependent_rows), self._model.layout
        from_here = carried(layout, q, model)
        if qd is None:
            if self._start.near:  # there free directions lead off all branches
                _, from_here, _ = ordinary(model, from_here)
            along = np.random.default_rng(0).standard_normal(model.n)
        else:
            along = (carried(layout, q + qd, model) - from_here)[: model.n]
        return walk.missed(from_here, along, qd is not None)

    def explained(self, told: float, q: Floats, qd: Floats) -> tuple[str, str] | None:
        """(addition to the reason, remedy) for a step that could not be closed from q (blocks D,
        m) and q̇ (m/s); None if no singular position is near. `told` (m): by how much a stage
        found that one is missed. Stages of steps that are far too long find that too where
        lengths agree, so where the way can be followed it must confirm it."""
        gap = self._walked(q, qd)
        if told > 0.0 and (gap > 0.0 or not self._examined or self.on_the_way > 0.0):
            gap = told
        if not 0.0 < gap <= _MEANT * self._model.size:
            return self._beside(q, qd)
        remedy = 'take a smaller step, or ' + (
            'ask for a smaller tolerance' if self._tolerance else 'an adaptive integrator'
        )
        if self.reason == LENGTHS:
            plainly = f'let them differ by more than {_PLAIN:g} of the size; or '
            plainly = plainly if gap < _PLAIN * self._model.size else ''
            remedy = f'make the lengths agree, or {plainly}take a smaller step'
        verb = 'miss' if self.reason == LENGTHS else 'misses'
        return f': {self.reason} {verb} a singular position by about {gap:.1g} m', remedy

    def _beside(self, q: Floats, qd: Floats) -> tuple[str, str] | None:
        """The same for a motion that is no single pass, but stays beside a singular position."""
        model = self._model.apart()
        work = allocate(model, model.system, 0)
        if not kernel.linearise(model.unit, model.system, work, q):
            return None
        modes = found(model, work, self._start.dependent_rows)
        distance = float(modes.sigma[0]) if modes else 1.0
        if not distance < _BESIDE:
            return None
        if not model.system.departures.part.size and self._stays(q, qd):
            return (
                ': a loop rests in its singular position, or is slow there, beside moving parts',
                'let all begin at rest, or the loop with a speed or beside the position',
            )
        return (
            f': a singular position is near, at the distance {distance:.1g}',
            'take a smaller step; a motion that stays beside a singular position is not computed',
        )

    def _stays(self, q: Floats, qd: Floats) -> bool:
        """Whether q̇ (blocks D, m/s) at q (blocks D, m) leads along several branches of a singular
        position there, so that it does not tell on which of them a loop leaves."""
        here = singular_start.resting(self._start.model, q, self._start.dependent_rows)
        if here is None or not qd.any():
            return False
        least = _SLOW * float(np.abs(qd).max())
        return sum(each.off(qd) < least for each in here.branches) > 1

    def resolution(
        self, judged: Judged, told: float, beside: float, leapt: float, unexamined: str
    ) -> Resolution:
        """The resolution of steps `judged` (its first six fields), of which stages found that a
        position is missed by `told` (m), which went at most `beside` (m) beside one, and at most
        `leapt` (m) where one that leapt over it begins or ends; `unexamined` as of
        `Resolution`."""
        gap, size, too_long = told, self._model.size, judged[4]
        if told > 0.0 and too_long and self._examined and not self.on_the_way > 0.0:
            gap = 0.0  # as in `explained`
        # shorter steps follow the turn within √(gap size) that strictly there is; to adaptive ones
        # lengths that miss a position by less than the tolerance are the same
        way = _ACROSS * leapt if self._tolerance else beside
        if way > 0.0 and not told > 0.0:
            gap = self.on_the_way
            least = max(DRIFT, self._tolerance) * size
            gap = gap if least < gap < way**2 / size else 0.0
        return Resolution(*judged, gap, self.reason, unexamined)

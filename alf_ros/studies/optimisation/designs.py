"""Designs that an optimisation tries: their numbers of the motion, with gradients."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError, StoppedError
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.optimisation.design_goal import Asked, DesignGoal, DesignLimit
from alf_ros.studies.optimisation.design_numbers import DesignNumbers
from alf_ros.studies.optimisation.driven_design import DrivenDesign
from alf_ros.studies.optimisation.free_design import FreeDesign
from alf_ros.studies.optimisation.instants import DesignMotion

_DRAWN = 241  # places of a path that is drawn
_KEPT = 8  # designs that are known at a time
_RESOLVED = 1e-3  # of its size: a number that denser samples change by more has too few
Told = Callable[[int, float], None]  # designs so far, value of the last one


@dataclass(frozen=True, eq=False)
class Design:
    """One design: its numbers (P,), and the objective and the limited numbers of its motion."""

    values: Floats
    objective: Asked
    limited: tuple[Asked, ...]


@dataclass(frozen=True, eq=False)
class DesignCurve:
    """The picture of a goal: `y` (N,) over t (s), or the path (N, D) of a point, with the places
    `met` (K, D) on it that are compared with the wanted ones."""

    t: Floats
    y: Floats
    met: Floats | None = None


class Designs:
    """Evaluates designs of one study, one at a time.

    Each evaluation of `at` is counted in `tried`: the objective, or NaN for a design that cannot
    be.
    """

    def __init__(
        self,
        numbers: DesignNumbers,
        objective: DesignGoal,
        limits: Sequence[DesignLimit],
        duration: float,
        period: float,
        driven: bool,
    ) -> None:
        self.numbers, self.objective, self.limits = numbers, objective, tuple(limits)
        self._duration, self._period, self._driven = duration, period, driven
        self._known: dict[bytes, Design | AlfError] = {}
        self._before: Simulation | None = None
        self.tried: list[float] = []
        self.told: Told | None = None

    def at(self, values: Floats) -> Design:
        """The design of these numbers (P,). Raises AlfError for one that cannot be, and one at
        which the goals have no derivative."""
        key = np.asarray(values, dtype=float).tobytes()
        if key not in self._known:
            self._known[key] = self._tried(np.array(values, dtype=float))
            while len(self._known) > _KEPT:
                del self._known[next(iter(self._known))]
        found = self._known[key]
        if isinstance(found, AlfError):
            raise found
        return found

    def numbers_of(self, values: Floats) -> tuple[float, ...]:
        """The objective and the limited numbers of a design, without derivatives. Raises
        AlfError."""
        motion = self._motion(values)
        goals = (self.objective, *(limit.goal for limit in self.limits))
        return tuple(goal.value(motion) for goal in goals)

    def sizes_of(self, values: Floats) -> tuple[float, ...]:
        """How large the limited numbers are along the motion of a design. Raises AlfError."""
        motion = self._motion(values)
        return tuple(limit.goal.size(motion) for limit in self.limits)

    def notes(self, values: Floats) -> list[str]:
        """Conditions of the numbers of a design, one sentence each. Raises AlfError."""
        motion = self._motion(values)
        goals = (self.objective, *(limit.goal for limit in self.limits))
        found = [
            f'{goal.text} has two equal peaks: there it is not smooth, and the search may end '
            'before the optimum'
            for goal in goals
            if goal.has_equal_peaks(motion)
        ]
        found += self._unresolved(values, motion)
        return found + ([f'its run is not resolved: {motion.trouble}'] if motion.trouble else [])

    def _unresolved(self, values: Floats, motion: DesignMotion) -> list[str]:
        """The goals that denser samples change: their peaks and places lie between samples."""
        period = self._denser(motion.simulation.h)
        if period >= self._period:
            return []
        goals, found = (self.objective, *(limit.goal for limit in self.limits)), []
        try:
            denser = self._motion(values, period)
            each = [(goal.value(denser), goal.size(denser)) for goal in goals]
        except StoppedError:
            raise
        except AlfError as error:
            return [f'it cannot be between its samples: {error}']
        for goal, (there, size) in zip(goals, each, strict=True):
            if abs(goal.value(motion) - there) > _RESOLVED * size:
                told = f'with samples each {period:.3g} s it is {there:.6g} {goal.unit}'.rstrip()
                found.append(f'{goal.text} has too few samples: {told}; take a shorter period')
        return found

    def _denser(self, h: float) -> float:
        """A shorter period: half of it or a bit less, so that a motion of the same period does not
        look at rest to both; or of whole steps of h (s) where forces decide, if there is one."""
        if self._driven:
            return self._duration / (2 * round(self._duration / self._period) + 1)
        every = round(self._period / h)
        return h * max((k for k in range(1, every // 2 + 1) if every % k == 0), default=every)

    def curves(self, values: Floats) -> list[DesignCurve]:
        """Of the objective and of each limited number. Raises AlfError."""
        motion = self._motion(values)
        found = []
        for goal in (self.objective, *(limit.goal for limit in self.limits)):
            if goal.path is not None:
                fine = np.linspace(motion.t[0], motion.t[-1], max(motion.t.size, _DRAWN))
                y = motion.places(goal.path.point, fine)[0]
                found.append(DesignCurve(fine, y, goal.path.places_met(motion)))
                continue
            assert goal.quantity is not None
            y = goal.quantity.values(motion.samples)
            found.append(DesignCurve(motion.t, y))
        return found

    def _tried(self, values: Floats) -> Design | AlfError:
        try:
            motion = self._motion(values)
            goals = (self.objective, *(limit.goal for limit in self.limits))
            objective, *limited = (goal.of(motion) for goal in goals)
        except StoppedError:
            raise
        except AlfError as error:
            self.tried.append(np.nan)
            return error
        self._before = motion.simulation
        self.tried.append(objective.value)
        if self.told is not None:
            self.told(len(self.tried), objective.value)
        return Design(values, objective, tuple(limited))

    def _motion(self, values: Floats, period: float | None = None) -> DesignMotion:
        where = self.numbers, values, self._duration, period or self._period
        return DrivenDesign(*where) if self._driven else FreeDesign(*where, self._before)

"""How well fixed steps resolve the motion, as the kernel has measured it on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass

from alf_ros.arrays import Floats
from alf_ros.kernel.step_error import (
    FEWEST,
    LEVEL,
    MOST_UNRESOLVED,
    WORST,
    WORST_ERROR,
    WORST_STEPS,
    WORST_UNRESOLVED,
)

LENGTHS, MOTION = 'lengths', 'the motion'
_WINDOW = 1000.0  # steps
_AIM = 0.2  # of LEVEL: what an adequate step leaves of the error
_SHORTER = 0.2  # of a step beyond the stability limit, where nothing says how far beyond
_NICE = (5.0, 2.0, 1.0)  # first digits of a step


@dataclass(frozen=True)
class Resolution:
    """The worst 1000 steps or so since the start or the last restored state.

    `step` (s); `error`: sum of the estimated errors of these steps, displacements in parts of the
    size of the mechanism; `unresolved`: part of these steps in which an acceleration, of whatever
    size, is not resolved, as beyond the stability limit; `steps`: their number. NaN without a
    measurement: with adaptive integrators, which keep a tolerance, and in formulations other than
    alf2. `caution`: by how much the estimates may be too small. `crossing` (m): by how much a
    singular position was missed that steps passed, at best as if they met it; `missed_by`: the
    cause, `lengths` or, with several freedoms, `the motion`; `unexamined`: the part of the start,
    or of the state at rest that was set last, that was not examined, in words.
    """

    step: float
    error: float = math.nan
    unresolved: float = math.nan
    steps: float = math.nan
    too_long: bool = False
    caution: float = 1.0
    crossing: float = 0.0
    missed_by: str = LENGTHS
    unexamined: str = ''

    @property
    def chatters(self) -> bool:
        """Whether effects chatter step by step, as beyond the stability limit."""
        return self.too_long and self.unresolved * self.steps > MOST_UNRESOLVED

    @property
    def adequate(self) -> float:
        """A step (s) that would do, by how errors fall with it; `step` if that does."""
        return self.within((_SHORTER if self.chatters else 1.0) * self.step)

    def within(self, stable: float) -> float:
        """The same where steps are stable up to `stable` (s) or twice of it."""
        if not self.too_long:
            return self.step if self.error >= 0.0 else math.nan
        found = min(stable, self.step)
        allowed = LEVEL * max(self.steps, FEWEST) / _WINDOW
        error = self.caution * self.error
        if error > allowed:  # h^4 at the least, where steps are far too long
            found = min(found, self.step * (_AIM * allowed / error) ** 0.25)
        return nice(found)

    def trouble(self, adequate: float) -> str:
        """The faults in words, with a sufficient step (s) if steps are too long; empty without
        faults."""
        found = [self._too_long(adequate)] if self.too_long else []
        if self.crossing > 0.0:
            found.append(self._missed())
        return '; '.join(found) or self.unexamined

    def _missed(self) -> str:
        off = f'a singular position by about {self.crossing:.1g} m, which steps do not resolve'
        if self.missed_by == MOTION:
            return f'the motion misses {off}: they may take the other branch'
        return f'lengths miss {off}: at best it is passed as if they agreed; make them agree'

    def _too_long(self, adequate: float) -> str:
        part = f'{100.0 * self.caution * self.error:.2g} % of the size'
        errors = f'the errors of {self.steps:.0f} add up to {part}'
        beyond = f'{100.0 * self.unresolved:.0f} % of them are beyond the stability limit'
        return (
            f'steps of {self.step:g} s are too long: {beyond if self.chatters else errors}; '
            f'take {adequate:g} s or less, or an adaptive integrator'
        )


@dataclass(frozen=True)
class Known:
    """A resolution that need not be computed when it is asked for."""

    resolution: Resolution

    def __call__(self) -> Resolution:
        return self.resolution


Judged = tuple[float, float, float, float, bool, float]


def measured(step: float, judged: Floats, caution: float) -> Judged:
    """The first six fields of `Resolution` for steps of `step` (s), from `judged` as
    `kernel.step_error` writes it."""
    numbers = judged.tolist()
    steps = max(1.0, numbers[WORST_STEPS])
    error, unresolved = numbers[WORST_ERROR], numbers[WORST_UNRESOLVED] / steps
    too_long = numbers[WORST] > 1.0
    return step, error, unresolved, steps, too_long, caution


def nice(step: float) -> float:
    """The longest step (s) of one digit, 1, 2 or 5, that is not longer."""
    decade = 10.0 ** math.floor(math.log10(step))
    digit = next((digit for digit in _NICE if digit * decade <= step * (1.0 + 1e-9)), 0.5)
    return float(f'{digit * decade:.0e}')

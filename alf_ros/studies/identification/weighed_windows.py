"""Windows with the noise that weighs their measurements: residuals, and jacobians where they hold.

A start that measurements do not see would drift by rounding. So each one is held at its first
estimate, by a deviation of `UNSEEN` times its size. A number that is known to its own size, 100 %,
moves by 1e-6 of its deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.studies.identification.gauss_newton import secant
from alf_ros.studies.identification.identifiability import beside
from alf_ros.studies.identification.robust_loss import rooted
from alf_ros.studies.identification.window import Window
from alf_ros.studies.identification.window_runs import Attempt, Misfit, WindowRuns, WindowStart

UNSEEN = 1e3  # times the size: the deviation that holds what nothing sees
# a jacobian serves again where it has told the change of the residuals since but for this part,
_BENT = 0.1
_NEAR = 2.0  # or where the square of the change is as much as that of so many residuals


class WeighedWindows:
    """Windows with the noise (channels,) of each channel, and a loss."""

    def __init__(
        self, runs: WindowRuns, windows: Sequence[Window], noise: Floats, loss: str
    ) -> None:
        self._runs, self.windows, self._noise, self._loss = runs, windows, noise, loss
        self.is_own = True  # whether the last jacobians are of the place that was asked for
        model = runs.reference.model
        self._size = float(np.sqrt(model.mass_scale)) * model.size  # of a start, kg^½ m, kg^½ m/s

    @property
    def numbers(self) -> int:
        """How many numbers all windows share."""
        return self._runs.numbers

    def plain(self, free: Sequence[Floats], shared: Floats) -> list[Misfit]:
        """Of all windows, without jacobians."""
        return self.misfits(self.begun(free), shared, False)

    def differentiate(self, free: Sequence[Floats], shared: Floats) -> None:
        """Keep misfits with jacobians, for what asks next. Raises AlfError."""
        self.misfits(self.begun(free), shared, True)

    def begun(self, free: Sequence[Floats]) -> list[WindowStart]:
        """All windows with their starts."""
        return list(zip(self.windows, free, strict=True))

    def misfits(
        self, starts: Sequence[WindowStart], shared: Floats, differentiated: bool
    ) -> list[Misfit]:
        """Of some windows with their starts. Raises AlfError."""
        delay, values = self._split(shared)
        most = max((w.chart.free.size for w in self.windows if w.chart is not None), default=0)
        return self._runs.misfits_at(values, starts, delay, most if differentiated else None)

    def linearised(self, free: Sequence[Floats], shared: Floats) -> list[Misfit]:
        """Of all windows, with jacobians: the last ones, with the secants since, if these hold.
        Raises AlfError."""
        now, found, told, bent = self.plain(free, shared), [], 0.0, 0.0
        for window, own, here in zip(self.windows, free, now, strict=True):
            last = self._runs.last(window)
            if last is None:
                break
            x, before = last
            noise = self._noise[here.channel]
            moved = np.concatenate([shared, own]) - x
            change = before.jacobian @ moved
            off = here.residuals - before.residuals - change
            told += float(np.sum((change / noise) ** 2))
            bent += float(np.sum((off / noise) ** 2))
            found.append(replace(here, jacobian=secant(before.jacobian, moved, off)))
        r = np.concatenate([each.residuals / self._noise[each.channel] for each in now])
        holds = told <= _NEAR * float(np.mean(r**2)) or bent <= _BENT**2 * told
        if len(found) < len(now) or not holds:
            self.is_own = True
            return self.misfits(self.begun(free), shared, True)
        if told > 0.0:
            delay, values = self._split(shared)
            for (window, own), each in zip(self.begun(free), found, strict=True):
                self._runs.keep_secant(values, window, own, delay, each)
        self.is_own = not any(map(self._runs.has_secant, self.windows))
        return found

    def attempts(self, starts: Sequence[WindowStart], shared: Floats) -> list[Attempt]:
        """Of some windows with their starts, without jacobians, or why their runs fail."""
        delay, values = self._split(shared)
        return self._runs.attempts_at(values, starts, delay, None)

    def by_starts(self, starts: Sequence[WindowStart], shared: Floats) -> list[Attempt]:
        """The same with jacobians by the starts alone."""
        delay, values = self._split(shared)
        return self._runs.by_starts(values, starts, delay)

    def _split(self, shared: Floats) -> tuple[float, Floats]:
        """The delay, and the numbers of the scene."""
        delay = float(shared[-1]) if self._runs.delay else 0.0
        return delay, shared[: len(self._runs.names)]

    def information(self, free: Sequence[Floats], shared: Floats) -> list[tuple[Floats, Floats]]:
        """B⊥ (N, P) of each window, and its residuals (N,) in units of the noise: with jacobians
        of this very place, in which undetermined combinations vanish. Raises AlfError."""
        found = []
        misfits = self.misfits(self.begun(free), shared, True)
        for window, misfit in zip(self.windows, misfits, strict=True):
            r, J = self.scaled(misfit)
            assert window.chart is not None
            of_start = np.vstack([J[:, self.numbers :], window.chart.known])
            of_numbers = np.zeros((len(of_start), self.numbers))
            of_numbers[: len(J)] = J[:, : self.numbers]
            found.append((beside(of_start, of_numbers), r))
        return found

    def scaled(self, misfit: Misfit) -> tuple[Floats, Floats]:
        """Residuals and jacobian in units of the noise."""
        noise = self._noise[misfit.channel]
        return misfit.residuals / noise, misfit.jacobian / noise[:, None]

    def rooted(self, window: Window, free: Floats, misfit: Misfit) -> tuple[Floats, Floats]:
        """φ and its derivatives, and behind them what holds the start."""
        r, J = self.scaled(misfit)
        value, slope = rooted(self._loss, r)
        assert window.chart is not None
        weak, known = 1.0 / (UNSEEN * self._size), window.chart.known
        held = np.zeros((free.size + len(known), J.shape[1]))
        if J.size:
            held[:, J.shape[1] - free.size :] = np.vstack([weak * np.eye(free.size), known])
        return (
            np.concatenate([value, weak * (free - window.chart.free), known @ free]),
            np.vstack([J * slope[:, None], held]),
        )

"""Residuals of windows, read by channel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.studies.identification.window import Window
from alf_ros.studies.identification.window_runs import Misfit


class WindowResiduals:
    """Of windows, each with its misfit; in units of the measurements."""

    def __init__(self, misfits: Sequence[Misfit], windows: Sequence[Window]) -> None:
        self._misfits, self._windows = misfits, windows

    @property
    def joined(self) -> tuple[Floats, Integers]:
        """(N,) all, and the channel of each."""
        return (
            np.concatenate([each.residuals for each in self._misfits]),
            np.concatenate([each.channel for each in self._misfits]),
        )

    def of(self, channel: int) -> list[Floats]:
        """Of a channel, a sequence of each window."""
        return [each.residuals[each.channel == channel] for each in self._misfits]

    def times(self, channel: int) -> list[Floats]:
        """Their times, s."""
        nothing = np.zeros(0)
        return [
            next((part.t for part in window.measured if part.channel == channel), nothing)
            for window in self._windows
        ]

    @property
    def trouble(self) -> str:
        """Steps that are too long, in words, of the window where they are worst; or empty."""
        found = [each.resolution() for each in self._misfits]
        worst = max(
            found, key=lambda each: (each.too_long, each.caution * each.error, each.crossing)
        )
        return worst.trouble(worst.adequate)

    def rms(self, channel: int) -> float:
        """Root of the mean square of a channel; NaN without windows."""
        whole = np.concatenate([np.zeros(0), *self.of(channel)])
        return float(np.sqrt(np.mean(whole**2))) if whole.size else float('nan')

"""The starts of windows that fit best, with shared numbers that stay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError
from alf_ros.studies.identification.gauss_newton import best_gain, best_step
from alf_ros.studies.identification.weighed_windows import WeighedWindows
from alf_ros.studies.identification.window import Window
from alf_ros.studies.identification.window_runs import Misfit, WindowStart, succeeded

_MOST = 60  # steps
_LOST, _NOISY = 0.1, 30.0  # parts of the motion of a joint; times its noise
_SHORTENED = 8  # times that a step is made shorter


def best_starts(
    windows: WeighedWindows,
    shared: Floats,
    free: Sequence[Floats],
    tolerance: float,
    most: int = _MOST,
) -> tuple[Floats, ...]:
    """The best start of each window with shared numbers that stay, by so many Gauss-Newton steps
    at most, which are shortened where they gain nothing. A start from which no run succeeds
    stays."""
    found = list(free)
    going = [n for n, own in enumerate(found) if own.size]
    for _ in range(most):
        steps = _steps(windows, found, going, shared, tolerance)
        going = []
        for _ in range(_SHORTENED):
            tried = {n: found[n] + step for n, (step, _) in steps.items()}
            starts = [(windows.windows[n], x) for n, x in tried.items()]
            for (n, x), cost in zip(tried.items(), costs(windows, starts, shared), strict=True):
                step, before = steps.pop(n)
                if cost < before:
                    found[n] = x
                    going.append(n)
                else:
                    steps[n] = 0.25 * step, before
            if not steps:
                break
        if not going:
            break
    return tuple(found)


def surest_starts(
    windows: WeighedWindows,
    linear: WeighedWindows,
    shared: Floats,
    free: Sequence[Floats],
    tolerance: float,
) -> tuple[Floats, ...]:
    """The same for a loss that hardly feels far residuals: also from the best starts of the same
    windows with the `linear` one, which feels them. Of each window the better one counts."""
    own = best_starts(windows, shared, free, tolerance)
    other = best_starts(windows, shared, best_starts(linear, shared, free, tolerance), tolerance)
    each = [costs(windows, windows.begun(starts), shared) for starts in (own, other)]
    found = zip(own, other, *each, strict=True)
    return tuple(here if first <= second else there for here, there, first, second in found)


def _steps(
    windows: WeighedWindows,
    free: Sequence[Floats],
    going: Sequence[int],
    shared: Floats,
    tolerance: float,
) -> dict[int, tuple[Floats, float]]:
    """Of the windows that are not at their best starts: a step there, and ½ Σ φ² here."""
    starts, found = [(windows.windows[n], free[n]) for n in going], {}
    for n, start, misfit in zip(going, starts, windows.by_starts(starts, shared), strict=True):
        if isinstance(misfit, AlfError):
            continue
        value, J = windows.rooted(*start, misfit)
        cost = 0.5 * float(value @ value)
        if best_gain(value, J) > tolerance * cost:
            found[n] = best_step(value, J), cost
    return found


def costs(windows: WeighedWindows, starts: Sequence[WindowStart], shared: Floats) -> list[float]:
    """½ Σ φ² of windows; infinite where a run fails."""
    found = []
    for start, misfit in zip(starts, windows.attempts(starts, shared), strict=True):
        if isinstance(misfit, AlfError):
            found.append(np.inf)
        else:
            value, _ = windows.rooted(*start, misfit)
            found.append(0.5 * float(value @ value))
    return found


def nearer_starts(windows: WeighedWindows, shared: Floats, free: Sequence[Floats]) -> list[Floats]:
    """The starts of the windows a Gauss-Newton step nearer to the best ones. Raises AlfError."""
    starts = windows.begun(free)
    found = []
    for (window, own), each in zip(starts, windows.by_starts(starts, shared), strict=True):
        found.append(own + best_step(*windows.rooted(window, own, succeeded(each))))
    return found


def is_lost(windows: WeighedWindows, window: Window, misfit: Misfit) -> bool:
    """Whether a run has left the recording: a joint is off by a good part of its motion there, and
    by far more than its noise."""
    scaled, _ = windows.scaled(misfit)
    for part in window.measured:
        own = misfit.channel == part.channel
        if own.any() and _rms(misfit.residuals[own]) > _LOST * np.ptp(part.values):
            if _rms(scaled[own]) > _NOISY:
                return True
    return False


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values * values)))

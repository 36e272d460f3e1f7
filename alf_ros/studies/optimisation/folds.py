"""From the values of a quantity at samples to one number, with its derivatives by the values.

A number is written as `max(…)`, `final(…)` and so on. Extremes and crossings lie between samples,
on the polynomial of the six nearest ones. Its number depends on these values alone: of an
extreme the instant does not count to first order. Of a crossing the instant is the number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError
from alf_ros.studies.ensemble.kept_outputs import integral
from alf_ros.studies.optimisation.near_samples import near

_PEAKS = 3  # the largest samples around which the extreme is looked for


@dataclass(frozen=True, eq=False)
class Folded:
    """A number of N samples: its value, and `weights` (N,), its derivatives by the values.

    t (s): the instant it belongs to; others: the other peaks, from the largest one."""

    value: float
    weights: Floats
    t: float | None = None
    others: tuple[Folded, ...] = ()


def _final(t: Floats, y: Floats) -> Folded:
    weights = np.zeros(t.size)
    weights[-1] = 1.0
    return Folded(float(y[-1]), weights, float(t[-1]))


def _integral(t: Floats, y: Floats) -> Folded:
    weights = integral(t, np.eye(t.size))
    return Folded(float(weights @ y), weights)


def _mean(t: Floats, y: Floats) -> Folded:
    weights = integral(t, np.eye(t.size)) / (t[-1] - t[0])
    return Folded(float(weights @ y), weights)


def _rms(t: Floats, y: Floats) -> Folded:
    weights = integral(t, np.eye(t.size)) / (t[-1] - t[0])
    value = float(np.sqrt(weights @ (y * y)))
    return Folded(value, weights * y / value if value > 0.0 else np.zeros(t.size))


def _least(t: Floats, y: Floats) -> Folded:
    found = _largest(t, -y)
    others = tuple(Folded(-each.value, each.weights, each.t) for each in found.others)
    return Folded(-found.value, found.weights, found.t, others)


def _largest(t: Floats, y: Floats) -> Folded:
    edges = np.concatenate([[-np.inf], y, [-np.inf]])
    peaks = np.flatnonzero((edges[1:-1] >= edges[:-2]) & (edges[1:-1] > edges[2:]))
    order = peaks[np.argsort(-y[peaks], kind='stable')][:_PEAKS]
    found = sorted((_peak(t, y, int(n)) for n in order), key=lambda each: -each.value)
    return Folded(found[0].value, found[0].weights, found[0].t, tuple(found[1:]))


def _peak(t: Floats, y: Floats, n: int) -> Folded:
    """The largest value of the polynomial, up to the samples beside n."""
    window = near(t, float(t[n]))
    values = y[window.of]
    p = window.coefficients(values)
    low, high = (min(max(k, 0), t.size - 1) - window.of.start for k in (n - 1, n + 1))
    roots = polynomial.polyroots(np.trim_zeros(polynomial.polyder(p), 'b'))
    inside = [x.real for x in roots.tolist() if abs(x.imag) < 1e-9 and low < x.real < high]
    places = [float(n - window.of.start), *inside]
    best = max(places, key=lambda u: float(polynomial.polyval(u, p)))
    at = window.t(best)
    weights = np.zeros(t.size)
    weights[window.of] = window.at(at)
    return Folded(float(weights @ y), weights, at)


def value_at(t: Floats, y: Floats, at: float) -> Folded:
    """The value at an instant (s)."""
    window, weights = near(t, at), np.zeros(t.size)
    weights[window.of] = window.at(at)
    return Folded(float(weights @ y), weights, at)


def crossing(t: Floats, y: Floats, value: float, direction: str, what: str) -> Folded:
    """The first instant (s) at which a value is crossed. Raises AlfError if it is not."""
    off = y - value
    up, down = (off[:-1] < 0.0) & (off[1:] >= 0.0), (off[:-1] > 0.0) & (off[1:] <= 0.0)
    wanted = np.flatnonzero({'up': up, 'down': down, 'both': up | down}[direction])
    if not wanted.size:
        raise AlfError(f'{what} does not cross {value:g}')
    n = int(wanted[0])
    window = near(t, float(t[n]))
    p = window.coefficients(off[window.of])
    low, high = float(n - window.of.start), float(n + 1 - window.of.start)
    falls = bool(off[n] > 0.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        here = float(polynomial.polyval(middle, p))
        low, high = (middle, high) if (here > 0.0) == falls and here != 0.0 else (low, middle)
    at = window.t(high)
    rate = float(window.rate(at) @ off[window.of])
    if rate == 0.0:
        raise AlfError(f'{what} touches {value:g} and does not cross it')
    weights = np.zeros(t.size)
    weights[window.of] = -window.at(at) / rate
    return Folded(at, weights, at)


FOLDS: dict[str, Callable[[Floats, Floats], Folded]] = {
    'max': _largest,
    'min': _least,
    'final': _final,
    'mean': _mean,
    'integral': _integral,
    'rms': _rms,
}

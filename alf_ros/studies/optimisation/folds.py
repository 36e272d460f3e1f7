"""From the values of a quantity at samples to one number, with its derivatives by the values.

A number is written as `max(…)`, `final(…)` and so on. Extremes and crossings lie between samples,
on the polynomial of the six nearest ones. Its number depends on these values alone: of an
extreme the instant does not count to first order. Of a crossing the instant is the number. Where
the quantity jumps, each side has its own polynomials, integrals and extremes (`smooth_pieces`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import polynomial

from alf_ros.arrays import Floats
from alf_ros.errors import AlfError
from alf_ros.studies.ensemble.kept_outputs import integral_weights
from alf_ros.studies.optimisation.near_samples import NearSamples, near
from alf_ros.studies.optimisation.smooth_pieces import NO_INSTANTS, SmoothPiece, smooth_pieces

_PEAKS = 3  # the largest samples around which the extreme is looked for
_BEYOND = 4  # samples of a polynomial that goes on beyond them: more of them would swing


@dataclass(frozen=True, eq=False)
class Folded:
    """A number of N samples: its value, and `weights` (N,), its derivatives by the values.

    t (s): the instant it belongs to; others: the other peaks, from the largest one. jumps (s): the
    known instants of jumps with which it changes, if they move."""

    value: float
    weights: Floats
    t: float | None = None
    others: tuple[Folded, ...] = ()
    jumps: tuple[float, ...] = ()


def unit_of(fold: str, unit: str) -> str:
    """Of a number that is folded from a quantity of this unit."""
    return f'{unit} s'.strip() if fold == 'integral' else unit


def _final(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> Folded:
    return _sample(t, y, t.size - 1)


def _integral(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> Folded:
    weights, jumps = _integrating(t, y, instants)
    return Folded(float(weights @ y), weights, jumps=jumps)


def _mean(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> Folded:
    weights, jumps = _integrating(t, y, instants)
    weights /= t[-1] - t[0]
    return Folded(float(weights @ y), weights, jumps=jumps)


def _rms(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> Folded:
    weights, jumps = _integrating(t, y, instants)
    weights /= t[-1] - t[0]
    value = float(np.sqrt(max(0.0, float(weights @ (y * y)))))
    slopes = weights * y / value if value > 0.0 else np.zeros(t.size)
    return Folded(value, slopes, jumps=jumps)


def _integrating(t: Floats, y: Floats, instants: Floats) -> tuple[Floats, tuple[float, ...]]:
    """(N,) weights of the values in their integral: the sum over the pieces, and where the instant
    of a jump is not known, the mean of both sides over the time between their samples. And the
    known instants."""
    pieces, weights = smooth_pieces(t, y, instants), np.zeros(t.size)
    for piece in pieces:
        own = t[piece.of]
        weights[piece.of] += integral_weights(own)
        for begin, end in ((piece.begin, float(own[0])), (float(own[-1]), piece.end)):
            if begin < end:
                window = _around(t, piece, 0.5 * (begin + end))
                weights[window.of] += window.integral(begin, end)
    for one, other in pairwise(pieces):
        weights[[one.last, other.first]] += 0.5 * (other.begin - one.end)
    return weights, _known(pieces)


def _known(pieces: list[SmoothPiece]) -> tuple[float, ...]:
    """The known instants (s) of the jumps between pieces."""
    return tuple(other.begin for one, other in pairwise(pieces) if one.end == other.begin)


def _around(t: Floats, piece: SmoothPiece, at: float) -> NearSamples:
    """The samples of a piece around an instant in it."""
    if t[piece.first] <= at <= t[piece.last]:
        return near(t, at, piece.of)
    return near(t, at, piece.of, _BEYOND)


def _least(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> Folded:
    found = _largest(t, -y, instants)
    others = tuple(Folded(-each.value, each.weights, each.t) for each in found.others)
    return Folded(-found.value, found.weights, found.t, others, found.jumps)


def _largest(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> Folded:
    pieces = smooth_pieces(t, y, instants)
    peaks = [(n, piece) for piece in pieces for n in _peaks_of(y, piece)]
    order = sorted(peaks, key=lambda each: -float(y[each[0]]))[:_PEAKS]
    found = [_peak(t, y, *each) for each in order]
    found += [_value(t, y, piece, at) for piece in pieces for at in _beyond(t, piece)]
    found.sort(key=lambda each: -each.value)
    best = found[0]
    jumps = tuple(at for at in _known(pieces) if at == best.t)
    return Folded(best.value, best.weights, best.t, tuple(found[1:]), jumps)


def _peaks_of(y: Floats, piece: SmoothPiece) -> list[int]:
    """The samples of a piece beside which there are no larger ones in it."""
    edges = np.concatenate([[-np.inf], y[piece.of], [-np.inf]])
    peaks = np.flatnonzero((edges[1:-1] >= edges[:-2]) & (edges[1:-1] > edges[2:]))
    return [piece.first + n for n in peaks.tolist()]


def _beyond(t: Floats, piece: SmoothPiece) -> Iterator[float]:
    """The ends (s) of a piece that lie beyond its samples."""
    if piece.begin < t[piece.first]:
        yield piece.begin
    if piece.end > t[piece.last]:
        yield piece.end


def _peak(t: Floats, y: Floats, n: int, piece: SmoothPiece) -> Folded:
    """The largest value of the polynomial, up to the samples beside n."""
    window = near(t, float(t[n]), piece.of)
    p = window.coefficients(y[window.of])
    low, high = (
        window.places[min(max(k, piece.first), piece.last) - window.of.start]
        for k in (n - 1, n + 1)
    )
    roots = polynomial.polyroots(polynomial.polytrim(polynomial.polyder(p)))
    inside = [x.real for x in roots.tolist() if abs(x.imag) < 1e-9 and low < x.real < high]
    best = max(inside, key=lambda u: float(polynomial.polyval(u, p)), default=None)
    if best is not None and polynomial.polyval(best, p) > y[n]:
        return _of(window, y, window.t(best))
    return _sample(t, y, n)


def _sample(t: Floats, y: Floats, n: int) -> Folded:
    """The value of a sample itself."""
    weights = np.zeros(t.size)
    weights[n] = 1.0
    return Folded(float(y[n]), weights, float(t[n]))


def _value(t: Floats, y: Floats, piece: SmoothPiece, at: float) -> Folded:
    return _of(_around(t, piece, at), y, at)


def _of(window: NearSamples, y: Floats, at: float) -> Folded:
    """The value of the polynomial of a window at an instant (s)."""
    weights = np.zeros(y.size)
    weights[window.of] = window.at(at)
    return Folded(float(weights @ y), weights, at)


def value_at(t: Floats, y: Floats, at: float, instants: Floats = NO_INSTANTS) -> Folded:
    """The value at an instant (s); where it jumps, behind the jump. Where the instant of a jump is
    not known, the nearest sample has it."""
    pieces = smooth_pieces(t, y, instants)
    piece = next((each for each in reversed(pieces) if each.begin <= at), pieces[0])
    if at <= piece.end:
        return _value(t, y, piece, at)
    n = piece.last + int(t[piece.last + 1] - at < at - t[piece.last])
    return _sample(t, y, n)


def crossing(
    t: Floats,
    y: Floats,
    value: float,
    direction: str,
    what: str,
    instants: Floats = NO_INSTANTS,
) -> Folded:
    """The first instant (s) at which a value is crossed, also by a jump. Raises AlfError if it is
    not, and where the instant of the jump is not known."""
    off, before, end = y - value, None, 0.0
    for piece in smooth_pieces(t, y, instants):
        ends = [*_beyond(t, piece)]
        values = [float(_value(t, off, piece, at).value) for at in ends]
        times = np.concatenate([t[piece.of], ends])
        order = np.argsort(times, kind='stable')
        times, along = times[order], np.concatenate([off[piece.of], values])[order]
        if before is not None and _crossed(before, along[:1], direction):
            if piece.begin > end:
                told = f'{what} jumps across {value:g} between t = {end:.6g} s and '
                raise AlfError(f'{told}{piece.begin:.6g} s: when, is not known')
            return Folded(piece.begin, np.zeros(t.size), piece.begin, jumps=(piece.begin,))
        found = _crossed(along[:-1], along[1:], direction)
        if found:
            n = found[0]
            return _root(t, off, piece, times[n], times[n + 1], f'{what} touches {value:g}')
        before, end = along[-1:], piece.end
    raise AlfError(f'{what} does not cross {value:g}')


def _crossed(one: Floats, other: Floats, direction: str) -> list[int]:
    """Where zero is crossed between one value and the other."""
    up, down = (one < 0.0) & (other >= 0.0), (one > 0.0) & (other <= 0.0)
    return np.flatnonzero({'up': up, 'down': down, 'both': up | down}[direction]).tolist()


def _root(
    t: Floats, off: Floats, piece: SmoothPiece, begin: float, end: float, touches: str
) -> Folded:
    """The instant between two others at which the polynomial of a piece vanishes."""
    window = _around(t, piece, begin)
    p = window.coefficients(off[window.of])
    low, high = window.u(begin), window.u(end)
    falls = bool(polynomial.polyval(low, p) > 0.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        here = float(polynomial.polyval(middle, p))
        low, high = (middle, high) if (here > 0.0) == falls and here != 0.0 else (low, middle)
    at = window.t(high)
    rate = float(window.rate(at) @ off[window.of])
    if rate == 0.0:
        raise AlfError(f'{touches} and does not cross it')
    weights = np.zeros(t.size)
    weights[window.of] = -window.at(at) / rate
    return Folded(at, weights, at)


FOLDS: dict[str, Callable[..., Folded]] = {
    'max': _largest,
    'min': _least,
    'final': _final,
    'mean': _mean,
    'integral': _integral,
    'rms': _rms,
}

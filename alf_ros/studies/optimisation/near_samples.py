"""The polynomial through the samples nearest to an instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from alf_ros.arrays import Floats

_SAMPLES = 6
_EVEN = 1e-6  # of a period: samples that are further off their place are not equally spaced


@dataclass(frozen=True, eq=False)
class NearSamples:
    """Some samples, `of` all, with a polynomial through them.

    u = (t - first) / period; the samples are at `places` (count,), which count them from 0 where
    they are equally spaced.
    """

    of: slice
    first: float
    period: float
    places: Floats

    def at(self, t: float) -> Floats:
        """(count,) weights of the values in the polynomial at t (s)."""
        return self._weights(self._bases, t)

    def rate(self, t: float) -> Floats:
        """(count,) weights of the values in its slope at t, 1/s."""
        return (
            self._weights(np.asarray(polynomial.polyder(self._bases), dtype=float), t)
            / self.period
        )

    def integral(self, begin: float, end: float) -> Floats:
        """(count,) weights of the values in its integral between two instants, s."""
        bases = np.asarray(polynomial.polyint(self._bases), dtype=float)
        return (self._weights(bases, end) - self._weights(bases, begin)) * self.period

    def coefficients(self, values: Floats) -> Floats:
        """Of the polynomial in u, ascending, through values (count,)."""
        return np.asarray(self._bases @ values)

    def t(self, u: float) -> float:
        """The instant (s)."""
        return self.first + u * self.period

    def u(self, t: float) -> float:
        """The place of an instant (s)."""
        return (t - self.first) / self.period

    @property
    def _bases(self) -> Floats:
        """(degree + 1, count) coefficients in u of the polynomials that are 1 at one sample."""
        columns = []
        for k, place in enumerate(self.places.tolist()):
            others = np.delete(self.places, k)
            columns.append(polynomial.polyfromroots(others) / np.prod(place - others))
        return np.array(columns).T

    def _weights(self, bases: Floats, t: float) -> Floats:
        u = self.u(t)
        return np.asarray([polynomial.polyval(u, column) for column in bases.T])


def near(t: Floats, at: float, among: slice | None = None, most: int = _SAMPLES) -> NearSamples:
    """The samples around an instant: `most`, or all `among` which they are if these are fewer.

    t (N,) s, ascending, and equally spaced but for the first and the last one.
    """
    first = among.start if among is not None else 0
    own = t[among] if among is not None else t
    period = float(own[-1] - own[0]) / (own.size - 1) if own.size > 1 else 1.0
    count = min(most, own.size)
    middle = int(np.searchsorted(own, at + 1e-9 * period, 'right')) - 1
    start = min(max(middle - count // 2 + 1, 0), own.size - count)
    window = own[start : start + count]
    places, even = (window - window[0]) / period, np.arange(count, dtype=float)
    if np.abs(places - even).max() <= _EVEN:
        places = even
    of = slice(first + start, first + start + count)
    return NearSamples(of, float(window[0]), period, places)

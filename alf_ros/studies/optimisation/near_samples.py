"""The polynomial through the samples nearest to an instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from alf_ros.arrays import Floats

_SAMPLES = 6


@dataclass(frozen=True, eq=False)
class NearSamples:
    """Some equally spaced samples, `of` all, with a polynomial through them.

    u = (t - first) / period counts them from 0.
    """

    of: slice
    first: float
    period: float

    @property
    def count(self) -> int:
        """How many they are."""
        return int(self.of.stop - self.of.start)

    def at(self, t: float) -> Floats:
        """(count,) weights of the values in the polynomial at t (s)."""
        return self._weights(self._bases, t)

    def rate(self, t: float) -> Floats:
        """(count,) weights of the values in its slope at t, 1/s."""
        return (
            self._weights(np.asarray(polynomial.polyder(self._bases), dtype=float), t)
            / self.period
        )

    def coefficients(self, values: Floats) -> Floats:
        """Of the polynomial in u, ascending, through values (count,)."""
        return np.asarray(self._bases @ values)

    def t(self, u: float) -> float:
        """The instant (s)."""
        return self.first + u * self.period

    @property
    def _bases(self) -> Floats:
        """(degree + 1, count) coefficients in u of the polynomials that are 1 at one sample."""
        u = np.arange(self.count, dtype=float)
        columns = []
        for k in range(self.count):
            others = np.delete(u, k)
            columns.append(polynomial.polyfromroots(others) / np.prod(u[k] - others))
        return np.array(columns).T

    def _weights(self, bases: Floats, t: float) -> Floats:
        u = (t - self.first) / self.period
        return np.asarray([polynomial.polyval(u, column) for column in bases.T])


def near(t: Floats, at: float) -> NearSamples:
    """The six samples around an instant, all if they are fewer; t (N,) s, equally spaced."""
    period = float(t[-1] - t[0]) / (t.size - 1)
    count = min(_SAMPLES, t.size)
    middle = int(np.floor((at - float(t[0])) / period + 1e-9))
    start = min(max(middle - count // 2 + 1, 0), t.size - count)
    return NearSamples(slice(start, start + count), float(t[start]), period)

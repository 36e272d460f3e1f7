"""A signal of any length in bounded memory, so that a plot of it keeps every peak."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats


class Trace:
    """Signals of common times in at most `rows` rows: of each `group` of neighbouring values the
    lowest and the highest. `group` is doubled when the rows are full.

    t (k,) s: of the first of each group; low, high (k, signals): NaN where no value is a number.
    """

    def __init__(self, signals: int, rows: int) -> None:
        """`rows` is even."""
        self._rows = rows
        self._t = np.empty(rows)
        self._low, self._high = np.empty((2, rows, signals))
        self._count = 0
        self.group = 1
        self._filled = 0  # values in the last row

    def add(self, t: Floats, values: Floats) -> None:
        """Continue with values (n, signals) at times t (n,)."""
        at = 0
        while at < len(t):
            if self._count and self._filled < self.group:
                at += self._fill(values[at:])
                continue
            if self._count == self._rows:
                self._merge()
            whole = min((len(t) - at) // self.group, self._rows - self._count)
            if whole:
                end = at + whole * self.group
                groups = values[at:end].reshape(whole, self.group, -1)
                new = slice(self._count, self._count + whole)
                self._t[new] = t[at : end : self.group]
                self._low[new] = np.fmin.reduce(groups, axis=1)
                self._high[new] = np.fmax.reduce(groups, axis=1)
                self._count, self._filled, at = new.stop, self.group, end
            else:
                self._t[self._count] = t[at]
                self._low[self._count] = self._high[self._count] = np.nan
                self._count, self._filled = self._count + 1, 0

    def _fill(self, values: Floats) -> int:
        """Put values into the last row, as many as fit; returns their number."""
        some, last = values[: self.group - self._filled], self._count - 1
        self._low[last] = np.fmin(self._low[last], np.fmin.reduce(some))
        self._high[last] = np.fmax(self._high[last], np.fmax.reduce(some))
        self._filled += len(some)
        return len(some)

    def _merge(self) -> None:
        """Two groups make one."""
        half = self._rows // 2
        self._t[:half] = self._t[::2]
        self._low[:half] = np.fmin(self._low[::2], self._low[1::2])
        self._high[:half] = np.fmax(self._high[::2], self._high[1::2])
        self._count = half
        self.group *= 2
        self._filled = self.group

    @property
    def t(self) -> Floats:
        """(k,) s, the time of the first value of each group."""
        return self._t[: self._count]

    @property
    def low(self) -> Floats:
        """(k, signals) the lowest value of each group; NaN if no value is a number."""
        return self._low[: self._count]

    @property
    def high(self) -> Floats:
        """(k, signals) the highest value of each group; NaN if no value is a number."""
        return self._high[: self._count]


class Instants:
    """Every `stride`-th of a row of instants; `stride` is doubled when there are too many."""

    def __init__(self, most: int) -> None:
        self._most, self._seen = most, 0
        self._t: list[Floats] = []
        self._values: list[Floats] = []
        self._count = 0
        self.stride = 1

    def add(self, t: Floats, values: Floats) -> None:
        """Continue with instants t (n,) s and what there is at each, values (n, …)."""
        first = -self._seen % self.stride
        self._seen += len(t)
        # Copies: a view would keep the whole chunk of the log in memory.
        self._t.append(t[first :: self.stride].copy())
        self._values.append(values[first :: self.stride].copy())
        self._count += len(self._t[-1])
        while self._count > self._most:
            self._t, self._values = [self.t[::2].copy()], [self.values[::2].copy()]
            self._count = len(self._t[0])
            self.stride *= 2

    @property
    def t(self) -> Floats:
        """(k,) s; at least one instant must have been added."""
        return np.concatenate(self._t)

    @property
    def values(self) -> Floats:
        """(k, …)."""
        return np.concatenate(self._values)

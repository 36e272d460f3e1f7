"""The parts of sampled values between which they jump.

Values jump where an instant has two samples, one of each side, as where an input begins. Between
two samples a jump shows in the differences of fourth order: a jump by 1 adds 1, -3, 3, -1 to four
of them. No polynomial goes across: it would swing to values that there never are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from alf_ros.arrays import Floats

NO_INSTANTS: Floats = np.zeros(0)
_ORDER = 4  # of the differences
_JUMP = np.array([1.0, -3.0, 3.0, -1.0])  # of a jump by 1
_BESIDE = 2  # differences on either side that know nothing of it
_REST = 0.25  # of a jump: the differences of smooth values beside it
_LEAST = 1e-6  # of the largest value: a smaller jump is none
_CLOSE = 1e-6  # of the way between two samples: instants that rounding moved out of it


@dataclass(frozen=True)
class SmoothPiece:
    """Samples `first` to `last` of values that do not jump from `begin` to `end` (s). Where the
    instant of a jump is known, the piece reaches it, less than a period beyond its samples."""

    first: int
    last: int
    begin: float
    end: float

    @property
    def of(self) -> slice:
        """Its samples, of all."""
        return slice(self.first, self.last + 1)


def smooth_pieces(t: Floats, y: Floats, instants: Floats = NO_INSTANTS) -> list[SmoothPiece]:
    """The pieces of values y (N,) at t (N,) s. instants (s): at which forces or drives have kinks:
    one of them that lies alone in the way of a jump is the instant of the jump."""
    found, first, begin = [], 0, float(t[0])
    for n in _jumps(t, y):
        low, high = float(t[n]), float(t[n + 1])
        slack = _CLOSE * (high - low)
        known = instants[(instants >= low - slack) & (instants <= high + slack)]
        if known.size == 1:
            low = high = min(max(float(known[0]), low), high)
        found.append(SmoothPiece(first, n, begin, low))
        first, begin = n + 1, high
    return [*found, SmoothPiece(first, t.size - 1, begin, float(t[-1]))]


def _jumps(t: Floats, y: Floats) -> list[int]:
    """The samples behind which the values jump."""
    twice = np.flatnonzero(np.diff(t) == 0.0).tolist()
    found, least = [], _LEAST * float(np.abs(y).max())
    for first, last in zip([-1, *twice], [*twice, t.size - 1], strict=True):
        part = slice(first + 1, last + 1)
        found += [first + 1 + n for n in _unseen(y[part], least)]
        found.append(last)
    return found[:-1]


def _unseen(y: Floats, least: float) -> list[int]:
    """The samples behind which equally spaced values jump by more than `least`; two or more are
    on either side."""
    d = np.diff(y, _ORDER)
    if d.size < _ORDER:
        return []
    # behind sample n they are the differences n - 3 to n, as far as there are so many
    room = _BESIDE + _ORDER - 2
    values, there = (np.pad(each, room) for each in (d, np.ones(d.size)))
    size = _ORDER + 2 * _BESIDE
    pattern = np.pad(_JUMP, _BESIDE)
    windows, there = sliding_window_view(values, size), sliding_window_view(there, size)
    jump = windows @ pattern / (there @ pattern**2)
    rest = np.abs(windows - jump[:, None] * there * pattern).max(axis=1)
    clear = (rest <= _REST * np.abs(jump)) & (np.abs(jump) > least)
    return [n + 1 for n in np.flatnonzero(clear).tolist()]

"""How far a long reading is: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

_WIDTH = 30
_PERIOD = 0.1  # s between two pictures
_FIRST = 0.5  # s before the first: what is quick needs none

Report = Callable[[float], None]


def silent(part: float) -> None:
    """A report that nobody sees."""


class Progress:
    """Call it with the part that is done, 0 to 1; `close` removes the bar."""

    def __init__(self, what: str, stream: TextIO | None = None) -> None:
        self._what, self._stream = what, stream or sys.stderr
        self._start = time.monotonic()
        self._next = self._start + _FIRST
        self._shown = False
        self._live = self._stream.isatty()

    def __call__(self, part: float) -> None:
        now = time.monotonic()
        if not self._live or now < self._next:
            return
        self._next, self._shown = now + _PERIOD, True
        done = round(_WIDTH * part)
        left = (now - self._start) * (1.0 - part) / part if part > 0.0 else 0.0
        bar = '#' * done + '.' * (_WIDTH - done)
        self._stream.write(f'\r\x1b[K{self._what} [{bar}] {part:4.0%}, {left:.0f} s left')
        self._stream.flush()

    def close(self) -> None:
        """Remove the bar."""
        if self._shown:
            self._stream.write('\r\x1b[K')
            self._stream.flush()

"""A bar that counts, for commands that make many runs."""

from __future__ import annotations

import os
import sys


class ProgressBar:
    """How many of `total` are done, in one line of a terminal; nothing where stderr is none."""

    def __init__(self, total: int) -> None:
        self._total, self._done, self._shown = max(total, 1), 0, sys.stderr.isatty()

    def show(self, what: str) -> None:
        """Say what comes next; it counts as done at the following call."""
        if self._shown:
            full = 30 * self._done // self._total
            bar = '#' * full + '.' * (30 - full)
            text = f'\r\x1b[K[{bar}] {self._done}/{self._total}  {what}'
            print(text[: os.get_terminal_size(2).columns], end='', file=sys.stderr, flush=True)
        self._done += 1

    def clear(self) -> None:
        """Remove the bar."""
        if self._shown:
            print('\r\x1b[K', end='', file=sys.stderr, flush=True)

"""The progress bar of the commands."""

from __future__ import annotations

import os
import sys
import time

_WIDTH = 30
_PERIOD = 0.1  # s between two pictures of a part
_FIRST = 0.5  # s before the first of them: quick runs need none
_LINES = 10.0  # s between two lines where stderr is no terminal


class ProgressBar:
    """The progress of a command, on stderr.

    A terminal shows one line, which is written again and again. A file or a pipe gets a line at
    most every 10 s, and none in the first 10 s.

    For work that reports the part done, call the bar: it is a `Report` of `logs.progress`. For
    `total` runs one after the other call `show` before each. At the end of a `with` block the bar
    is removed.
    """

    def __init__(self, what: str = '', total: int = 1) -> None:
        self._what, self._total, self._done = what, max(total, 1), 0
        self._start = time.monotonic()
        self._live, self._shown = sys.stderr.isatty(), False
        self._next = self._start + (_FIRST if self._live else _LINES)

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()

    def __call__(self, part: float) -> None:
        """Show the part that is done, 0 to 1, and how long the rest will take."""
        now = time.monotonic()
        if self._is_due():
            left = (now - self._start) * (1.0 - part) / part if part > 0.0 else 0.0
            bar = f'{_bar(round(_WIDTH * part))} ' if self._live else ''
            self._print(f'{self._what} {bar}{part:4.0%}, {left:.0f} s left')

    def show(self, what: str) -> None:
        """Say which run comes next; it counts as done at the following call."""
        if self._live or self._is_due():
            bar = f'{_bar(_WIDTH * self._done // self._total)} ' if self._live else ''
            self._print(f'{bar}{self._done}/{self._total}  {what}')
        self._done += 1

    def note(self, text: str) -> None:
        """Show a line of another kind in place of the bar."""
        if self._is_due():
            self._print(f'{self._what} {text}')

    def line(self, text: str) -> None:
        """Print a line that stays."""
        self.clear()
        print(f'{self._what}: {text}', file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the bar, so that other lines can be printed; the next call shows it again."""
        if self._shown:
            print('\r\x1b[K', end='', file=sys.stderr, flush=True)
        self._shown = False

    def _is_due(self) -> bool:
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + (_PERIOD if self._live else _LINES)
        return True

    def _print(self, text: str) -> None:
        if not self._live:
            print(text.strip(), file=sys.stderr, flush=True)
            return
        columns = os.get_terminal_size(2).columns or None  # 0: the terminal does not know
        print(f'\r\x1b[K{text}'[:columns], end='', file=sys.stderr, flush=True)
        self._shown = True


def _bar(full: int) -> str:
    return f'[{"#" * full}{"." * (_WIDTH - full)}]'

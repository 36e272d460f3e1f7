"""Output on the terminal: start-up messages, then one live line."""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

# Seconds between two looks at the run.
LOOK_PERIOD = 0.25
# Seconds between two lines when nobody watches a terminal.
PLAIN_PERIOD = 5.0


class StatusLine:
    """Prints to `stream`. `live` is whether a line may be written over; `enabled` false prints
    nothing but what `say` is given."""

    def __init__(self, enabled: bool = True, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stdout
        self.live = self._stream.isatty()
        self.enabled = enabled
        self._open = False  # the cursor stands behind a live line
        self._gone = False

    def say(self, text: str) -> None:
        """Print a line that stays."""
        self._write(('\r\x1b[K' if self._open else '') + text + '\n')
        self._open = False

    def show(self, text: str) -> None:
        """Show the present state: over the last one on a terminal, else as a line of its own."""
        if not self.enabled:
            return
        if not self.live:
            self.say(text)
            return
        width = shutil.get_terminal_size().columns - 1
        self._write('\r\x1b[K' + text[:width])
        self._open = True

    @contextmanager
    def say_if_slow(self, text: Callable[[], str], seconds: float) -> Iterator[None]:
        """Print what `text` gives, if anything, once the block takes longer than `seconds`; on a
        terminal, time goes by."""
        over, started = threading.Event(), time.monotonic()

        def tell() -> None:
            said, wait = '', seconds
            while not over.wait(wait):
                now, wait = text(), 1.0
                if now and self.live:
                    self.show(f'{now} {time.monotonic() - started:.0f} s')
                elif now != said:
                    self.say(now)
                said = now or said
            if self.live and said:
                self.say(f'{said} {time.monotonic() - started:.0f} s')

        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        try:
            yield
        finally:
            over.set()
            teller.join()

    def _write(self, text: str) -> None:
        if self._gone:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:
            # The reader of a pipe, or the terminal, has gone: the simulation has not. What still
            # waits in the buffer must not fail again when the process ends.
            self._gone = True
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())

"""What a person at the terminal sees: start-up messages, then one live line."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

# Seconds between two looks at the run.
LOOK_PERIOD = 0.25
# Seconds between two lines when nobody watches a terminal.
PLAIN_PERIOD = 5.0


class Status:
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
    def say_if_slow(self, text: str, seconds: float) -> Iterator[None]:
        """Print `text` if the block takes longer than `seconds`; on a terminal, time goes by."""
        over, started = threading.Event(), time.monotonic()

        def tell() -> None:
            if over.wait(seconds):
                return
            if not self.live:
                self.say(text)
                return
            while True:
                self.show(f'{text} {time.monotonic() - started:.0f} s')
                if over.wait(1.0):
                    self.say(f'{text} {time.monotonic() - started:.0f} s')
                    return

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
            # The reader of a pipe has gone: the simulation has not.
            self._gone = True

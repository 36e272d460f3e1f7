"""SIGTERM ends a command as Ctrl-C does: it ends what it has begun. One line tells of SIGTERM;
Ctrl-C is quiet, because who presses it knows.

Commands that are nodes have handlers of their own.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType


class Terminated(KeyboardInterrupt):
    """SIGTERM came: all that hears Ctrl-C hears it."""


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated


@contextlib.contextmanager
def heard() -> Iterator[None]:
    """As a block, in which SIGTERM raises `Terminated` if it would end the process unheard.

    Of no effect in a thread, where Python has no handlers.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGTERM) is _terminate:  # else the command has one of its own
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def stopped(command: str, error: KeyboardInterrupt) -> int:
    """The end of a command by a signal; returns the exit code, 128 more than its number."""
    # CPython remembers a KeyboardInterrupt that has left a text given to `exec`, as the standard
    # library has some, also where it was caught. It would end by the signal, not by an exit code.
    # The next text makes it forget.
    exec('')
    if not isinstance(error, Terminated):
        return 128 + signal.SIGINT
    with contextlib.suppress(OSError):  # the reader of stderr may have gone
        print(f'alf_ros {command}: stopped by SIGTERM', file=sys.stderr, flush=True)
    return 128 + signal.SIGTERM

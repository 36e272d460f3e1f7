"""Signals held back while numba compiles or loads code.

Python runs the handlers of signals in the main thread, between any two instructions. An error that
a handler raises there, as for Ctrl-C, breaks off any call. numba does not bear that everywhere:
LLVM calls Python for the code that it links. If this call is broken off, LLVM links nothing and
the process ends when the code is called. A module of numba that is imported in part cannot be
imported again. So handlers wait until the work ends, or begins with another function.

Handlers of C that stand behind handlers of Python (rclpy has some) wait with them. A signal that
came in the meantime is raised again.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_SIGNALS = signal.valid_signals()
_SIZE = 1024  # bytes: more than `struct sigaction` has on any platform
_sigaction = ctypes.CDLL(None).sigaction

_depth = 0
_handlers: dict[int, tuple[Any, Any]] = {}  # of a signal: of Python, and what C has
_came: list[int] = []
_wakes = -1


@contextmanager
def held() -> Iterator[None]:
    """As a block: handlers run before it, after it, and where a block in it begins.

    In another thread than the main one there are no handlers to hold back.
    """
    global _depth
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    if _came:
        _release()
    if not _handlers:
        _hold()
    _depth += 1
    try:
        yield
    finally:
        _depth -= 1
        if _depth == 0:
            _release()


def _hold() -> None:
    """Put `_later` in the place of all handlers, or, if one of them raises, of none."""
    global _wakes
    with _blocked():
        _wakes = signal.set_wakeup_fd(-1)
        for number in _SIGNALS:
            handler = signal.getsignal(number)
            if callable(handler):
                action = ctypes.create_string_buffer(_SIZE)
                _sigaction(int(number), None, action)
                _handlers[number] = handler, action
                signal.signal(number, _later)


def _later(number: int, frame: Any) -> None:
    _came.append(number)


def _release() -> None:
    """All handlers as they were; then they hear the signals that came."""
    global _wakes
    with _blocked():
        for number, (handler, action) in _handlers.items():
            signal.signal(number, handler)
            _sigaction(int(number), action, None)
        _handlers.clear()
        if _wakes >= 0:
            signal.set_wakeup_fd(_wakes, warn_on_full_buffer=False)
            _wakes = -1
        for number in set(_came):
            signal.raise_signal(number)
        _came.clear()


@contextmanager
def _blocked() -> Iterator[None]:
    """As a block, in which no signal reaches this thread."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

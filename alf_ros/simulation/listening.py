"""How compiled code hears that it is to stop: from a signal, from another thread, from a node.

Compiled code asks a `Listener` after a time that is measured, some hundredths of a second: see
`alf_ros.kernel.stopping`. In the main thread the interpreter then runs the handlers of signals,
and what they raise ends the step. Signals reach no other thread: there it is asked whether the
main thread is on its way out after Ctrl-C.
"""

from __future__ import annotations

import ctypes
import sys
import threading
import time
from typing import Any

from alf_ros.errors import StoppedError
from alf_ros.kernel import Work
from alf_ros.kernel.stopping import GIVEN, LEFT, STOP

PERIOD = 0.02  # s of processor time between two looks: a step hears within a few of them
_FIRST = 8  # stages and rounds before the first look, when nobody knows how long they take
_GROWTH = 8.0  # by which their number may grow from look to look

_all_asked: list[bool] = []  # a list takes no lock, which a handler might meet locked


def stop_all() -> None:
    """End the steps of all simulations of this process, now and later, with StoppedError.

    For a program that is about to end. Any thread may call this, and a handler of signals.
    """
    _all_asked.append(True)


class Listener:
    """The requests of the compiled code of one workspace."""

    def __init__(self, work: Work) -> None:
        """It must live as long as `work` is used: this holds its address."""
        self._pulse, self._words = work.pulse, work.caller
        self._pulse[GIVEN] = self._pulse[LEFT] = _FIRST
        self._heard = time.thread_time()
        self._words[0] = id(self)

    def __call__(self) -> None:
        """Called by compiled code. The interpreter runs the handlers of signals before it."""
        # of this thread: time that others take, or hold the interpreter, makes no stage long
        now, pulse = time.thread_time(), self._pulse
        share = PERIOD / max(now - self._heard, PERIOD / _GROWTH)
        pulse[GIVEN] = pulse[LEFT] = max(1, int(share * pulse[GIVEN]))
        self._heard = now
        if _all_asked:
            raise StoppedError
        if _main_thread_leaves():
            raise KeyboardInterrupt

    def stop(self) -> None:
        """End the step that is taken, or the next one."""
        self._pulse[STOP] = 1

    def answer(self) -> None:
        """Raise what ended a step: what Python raised when it was asked, else StoppedError."""
        self._pulse[STOP] = 0
        type_, value, trace = self._words[1:].tolist()
        self._words[1:] = 0
        if type_:
            _raise(type_, value, trace)
        raise StoppedError


def _raise(type_: int, value: int, trace: int) -> None:
    """Raise an exception whose parts `PyErr_Fetch` gave away."""
    restore = ctypes.pythonapi['PyErr_Restore']
    restore.argtypes, restore.restype = [ctypes.c_void_p] * 3, None
    restore(type_ or None, value or None, trace or None)


def _main_thread_leaves() -> bool:
    """Whether this is another thread, and Ctrl-C has ended the main one or is about to."""
    main = threading.main_thread()
    if threading.get_ident() == main.ident:
        return False
    if not main.is_alive():
        return getattr(sys, 'last_type', None) is KeyboardInterrupt
    handled: Any = sys._current_exceptions().get(main.ident or 0)
    if isinstance(handled, tuple):  # before Python 3.12
        handled = handled[1]
    return isinstance(handled, KeyboardInterrupt)

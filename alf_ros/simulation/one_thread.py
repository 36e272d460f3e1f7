"""An object that one thread uses at a time: a second one is refused, not made to wait.

`with` on a lock of the interpreter cannot leave it locked, whatever signal comes when; a pair of
`acquire` and `release` could. Whether it is locked is therefore asked first: in the moment
between, a second thread waits for the first one, which is right as well.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from alf_ros.errors import BusyError


class Locked(Protocol):
    """An object with methods of this kind."""

    _lock: threading.Lock


P = ParamSpec('P')
R = TypeVar('R')
S = TypeVar('S', bound=Locked)


def by_one_thread(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """A method that raises BusyError while another call of this kind uses the object."""

    @functools.wraps(method)
    def alone(self: S, *args: P.args, **named: P.kwargs) -> R:
        lock = self._lock
        if lock.locked():
            raise BusyError(type(self).__name__, method.__name__)
        with lock:
            return method(self, *args, **named)

    return alone  # type: ignore[return-value]  # how mypy sees `wraps` of a method

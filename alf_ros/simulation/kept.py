"""Properties that are computed once, when they are first asked for, by one thread at a time.

As `functools.cached_property`, whose versions before Python 3.12 let no two objects compute the
same property at once, and the later ones let two threads write in the memory of one object.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar('T')


class Keeper:
    """An object with such properties."""

    def __init__(self) -> None:
        self._lock = threading.RLock()


class kept(Generic[T]):  # is written as `property` is
    """A property of a `Keeper` that it keeps."""

    def __init__(self, function: Callable[[Any], T]) -> None:
        self._function, self._name = function, function.__name__
        self.__doc__ = function.__doc__

    def __get__(self, of: Keeper | None, kind: type) -> T:
        if of is None:
            return self  # type: ignore[return-value]  # as all descriptors do
        known = of.__dict__
        with of._lock:
            if self._name not in known:
                known[self._name] = self._function(of)
        value: T = known[self._name]
        return value

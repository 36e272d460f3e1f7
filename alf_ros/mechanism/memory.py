"""Results of functions, remembered for arguments that are equal in all bits.

Members of a study, and the mechanisms that a search tries, differ in a few numbers: which block a
row binds, the elimination order, the fill and the shapes of most bodies are the same. A function
here depends on its arguments alone, and these are compared in full. So a mechanism of another
structure has results of its own, and no result depends on what the process has computed before:
0.0 and -0.0, which are equal in Python, are different arguments.
"""

from __future__ import annotations

import marshal
from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from threading import Lock
from typing import Any, TypeVar

import numpy as np

from alf_ros.columns import of_columns

F = TypeVar('F', bound=Callable[..., Any])
T = TypeVar('T')

_FORMAT = 2  # of marshal: the last one in which equal values have equal bytes
_LARGEST = 1 << 14  # bytes of a key, from which on nothing is kept


class ResultMemory:
    """Results by key: the last `most`, those used last. Any thread may ask."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, Lock()
        self._known: OrderedDict[Any, Any] = OrderedDict()

    def found(self, key: tuple[Any, ...], make: Callable[[], T]) -> T:
        """The result of a key, which `make` gives if it is not known. Arrays that it is, or that
        stand in a tuple, become read-only."""
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                known: T = self._known[key]
                return known
        result = make()
        for part in result if isinstance(result, tuple) else (result,):
            if isinstance(part, np.ndarray):
                part.flags.writeable = False
        if sum(len(each) for each in key if isinstance(each, bytes)) <= _LARGEST:
            with self._lock:
                self._known[key] = result
                if len(self._known) > self._most:
                    self._known.popitem(last=False)
        return result


def exactly(value: Any) -> bytes:
    """Numbers, texts and nested tuples of them as a part of a key. Raises ValueError for numbers
    of many members."""
    return marshal.dumps(value, _FORMAT)


def remembered(most: int) -> Callable[[F], F]:
    """A function whose results are kept in a `ResultMemory`.

    Its arguments are numbers, arrays, nested tuples of these, or objects that are compared by
    identity. Nothing is kept of arguments with numbers of many members (`columns`).
    """

    def of(function: F) -> F:
        memory = ResultMemory(most)

        @wraps(function)
        def known(*arguments: Any) -> Any:
            key: list[Any] = []
            for argument in arguments:
                if isinstance(argument, np.ndarray):
                    if of_columns(argument):
                        return function(*arguments)
                    key += argument.dtype.char, argument.shape, argument.tobytes()
                elif isinstance(argument, (float, int, tuple)):
                    try:
                        key.append(exactly(argument))
                    except ValueError:
                        return function(*arguments)
                elif getattr(argument, 'of_columns', False):
                    return function(*arguments)
                else:
                    key.append(argument)
            return memory.found(tuple(key), lambda: function(*arguments))

        return known  # type: ignore[return-value]

    return of

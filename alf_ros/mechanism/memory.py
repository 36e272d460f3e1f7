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

F = TypeVar('F', bound=Callable[..., Any])

_FORMAT = 2  # of marshal: the last one in which equal values have equal bytes
_LARGEST = 1 << 14  # bytes of arguments, from which on nothing is kept


def remembered(most: int) -> Callable[[F], F]:
    """A function whose last `most` results are kept, those used last.

    Its arguments are numbers, arrays, nested tuples of these, or objects that are compared by
    identity. Arrays that it returns, alone or in a tuple, become read-only. Any thread may call
    it.
    """

    def of(function: F) -> F:
        found: OrderedDict[tuple[Any, ...], Any] = OrderedDict()
        lock = Lock()

        @wraps(function)
        def known(*arguments: Any) -> Any:
            key: tuple[Any, ...] = ()
            for argument in arguments:
                if isinstance(argument, np.ndarray):
                    key += argument.dtype.char, argument.shape, argument.tobytes()
                elif isinstance(argument, (float, int, tuple)):
                    key += (marshal.dumps(argument, _FORMAT),)
                else:
                    key += (argument,)
            with lock:
                if key in found:
                    found.move_to_end(key)
                    return found[key]
            result = function(*arguments)
            for part in result if isinstance(result, tuple) else (result,):
                if isinstance(part, np.ndarray):
                    part.flags.writeable = False
            if sum(len(each) for each in key if isinstance(each, bytes)) <= _LARGEST:
                with lock:
                    found[key] = result
                    if len(found) > most:
                        found.popitem(last=False)
            return result

        return known  # type: ignore[return-value]

    return of

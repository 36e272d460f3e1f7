"""The kernel as plain Python, with NUMBA_DISABLE_JIT=1: for a debugger, coverage, bounds checks.

Then no function is compiled. A struct becomes a `View` of its numbers, an array of it a
`PlainVector`, which refuses indices outside; instructions for LLVM (`lowered`) have a twin in
Python; and a C function is found by a number that stands for its address. Sums are the same in the
same order.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numba.core import config
from numba.extending import intrinsic

PLAIN = bool(config.DISABLE_JIT)
_FIRST = 1 << 20  # no address of anything

_functions: list[Callable[..., Any]] = []
structs: WeakValueDictionary[int, Any] = WeakValueDictionary()  # by their addresses


def lowered(twin: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Instructions for LLVM, as an intrinsic of numba; `twin` does it in plain Python."""

    def decorate(function: Callable[..., Any]) -> Any:
        twin.__doc__ = function.__doc__
        return twin if PLAIN else intrinsic(function)

    return decorate


class PlainVector:
    """The numbers of a contiguous array, as compiled code has them: flat, whole numbers in 64 bit.

    Raises IndexError outside of them, before the first one too.
    """

    def __init__(self, array: Any) -> None:
        self.array = array
        self.size = np.uint64(array.size)
        self._number = np.uint64 if array.dtype.kind == 'u' else array.dtype.type

    def _at(self, i: Any) -> int:
        if not 0 <= i < len(self.array):
            raise IndexError(f'number {i} of {len(self.array)}')
        return int(i)

    def __getitem__(self, i: Any) -> Any:
        return self._number(self.array[self._at(i)])

    def __setitem__(self, i: Any, value: Any) -> None:
        self.array[self._at(i)] = value

    def behind(self, i: Any) -> PlainVector:
        """The numbers from the i-th on."""
        if not 0 <= i <= len(self.array):
            raise IndexError(f'number {i} of {len(self.array)}')
        return PlainVector(self.array[int(i) :])


def flat(array: Any, constant: bool = False) -> PlainVector:
    """The numbers of an array of any shape; `constant` if nobody may write them."""
    if isinstance(array, PlainVector):
        return array
    numbers = array.reshape(-1)  # contiguous: the same numbers, not a copy
    if constant:
        numbers = numbers.view()
        numbers.flags.writeable = False
    return PlainVector(numbers)


class View:
    """A struct as compiled code has it: Vectors, numbers of 64 bit, and Views."""


def argument(value: Any) -> Any:
    """An argument as compiled code receives it."""
    make = getattr(value, '_view', None)
    if make is not None:
        return make()
    return np.float64(value) if isinstance(value, float) else value


def entered(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that Python calls: its arguments as the kernel has them, and 1 / 0 = ∞."""

    @functools.wraps(function)
    def wrapper(*arguments: Any) -> Any:
        with np.errstate(all='ignore'):
            return function(*map(argument, arguments))

    return wrapper


class Function:
    """A C function that is none: its address is a number that `at` knows."""

    def __init__(self, signature: Any, function: Callable[..., Any]) -> None:
        self._sig = signature
        self._function = function
        self.address = _FIRST + len(_functions)
        _functions.append(function)

    def __call__(self, *arguments: Any) -> Any:
        return self._function(*arguments)


def found_at(address: Any) -> Any:
    """The struct at an address, as compiled code has it."""
    return argument(structs[int(address)])


def at(address: Any) -> Callable[..., Any]:
    """The function of an address."""
    return _functions[int(address) - _FIRST]

"""How the kernel is compiled: 64-bit, no fast-math, without the interpreter's lock, cached."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numba.core import sigutils
from numba.core.ccallback import CFunc

from alf_ros.kernel.numba_ext.c_functions import CCompiler
from alf_ros.kernel.numba_ext.cache import Cache
from alf_ros.kernel.numba_ext.inner_code import InnerCompiler
from alf_ros.kernel.numba_ext.plain import PLAIN, Function, entered
from alf_ros.kernel.numba_ext.structs import common_type

# whole numbers of 64 bit without sign: with Python integers sums would be floats
ZERO = np.uint64(0)
ONE = np.uint64(1)
TWO = np.uint64(2)
THREE = np.uint64(3)
FOUR = np.uint64(4)

# No wrappers for C: what is called by its address is made for that (`by_address`). Whether a
# function is inlined is said here: else the first function that calls it would decide that.
_options: dict[str, Any] = {
    'nogil': True,
    'error_model': 'numpy',
    'no_cfunc_wrapper': True,
    'forceinline': False,
}
_called_inside = {
    'no_cpython_wrapper': True,
    'pipeline_class': InnerCompiler,
}


def _of_common_types(template: Callable[..., Any]) -> Callable[..., Any]:
    """`get_call_template` of a dispatcher, which compiled code that calls it asks for its type.

    One variant serves all calls: else there would be one for each constant that is passed, and one
    for an array beside that for the vector of a struct, and LLVM would compile each.
    """

    def common(args: Any, kws: Any) -> Any:
        named = {name: common_type(kind) for name, kind in kws.items()}
        return template(tuple(map(common_type, args)), named)

    return common


def _cached(function: Callable[..., Any], **options: Any) -> Any:
    if PLAIN:
        return function
    dispatcher = njit(**options)(function)
    dispatcher.get_call_template = _of_common_types(dispatcher.get_call_template)
    dispatcher._cache = cache = Cache(function)
    dispatcher.compile = cache.guarded(dispatcher.compile)
    return dispatcher


def compiled(function: Callable[..., Any]) -> Any:
    """Code that Python calls, and compiled code."""
    return entered(function) if PLAIN else _cached(function, **_options)


def inner(function: Callable[..., Any]) -> Any:
    """For calls from compiled code only: omits the code that converts Python arguments."""
    return _cached(function, **_options, **_called_inside)


def inlined(function: Callable[..., Any]) -> Any:
    """The same, which LLVM puts into the code that calls it."""
    return _cached(function, **{**_options, **_called_inside, 'forceinline': True})


def shared(function: Callable[..., Any], **options: Any) -> Any:
    """A part of each effect that calls it."""
    return _cached(
        function, error_model='numpy', no_cfunc_wrapper=True, **_called_inside, **options
    )


# inlined into its caller: saves a compilation for functions with one or two callers
expanded = njit(**_options, inline='always')


def by_address(
    signature: Any, of: Callable[..., Any] | None = None, variant: str = '', **options: Any
) -> Callable[[Callable[..., Any]], Any]:
    """A C function, which the kernel calls by its `address`. It is compiled only if needed.

    `of`: the function that a closure passes on; its machine code is kept as code of that one, of
    this `variant` if closures of one signature differ. `options`: of numba.
    """

    def compile(function: Callable[..., Any]) -> Any:
        if PLAIN:
            return Function(signature, function)
        types = sigutils.normalize_signature(signature)
        all_options = {'error_model': 'numpy', **options}
        made: Any = CFunc(function, types, {}, all_options, pipeline_class=CCompiler)
        made._cache = cache = Cache(function if of is None else of, variant)
        cache.guarded(made.compile)()
        return made

    return compile

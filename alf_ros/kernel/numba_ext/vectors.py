"""Loops over vectors. Slices would do, but their error messages take seconds to compile.

`zero` and `copy` call the system's library. LLVM unrolls a loop, with guards against vectors that
overlap: for the few numbers of a small mechanism such a loop has more instructions than the call.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.plain import lowered
from alf_ros.kernel.numba_ext.structs import place_of


def _zero_plainly(to: Any) -> None:
    for i in range(int(to.size)):
        to[i] = 0.0


def _copy_plainly(of: Any, to: Any, n: Any = None) -> None:
    for i in range(int(to.size if n is None else n)):
        to[i] = of[i]


@lowered(_zero_plainly)
def zero(typing: Any, to: Any) -> Any:
    """to = 0."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data, count, width = place_of(context, builder, sig.args[0], args[0])
        cgutils.memset(builder, data, builder.mul(count, count.type(width)), 0)
        return context.get_dummy_value()

    return types.void(to), code


@lowered(_copy_plainly)
def copy(typing: Any, of: Any, to: Any) -> Any:
    """to = of, of the same type of numbers, which is as long or longer."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source, _, _ = place_of(context, builder, sig.args[0], args[0])
        data, count, width = place_of(context, builder, sig.args[1], args[1])
        cgutils.raw_memcpy(builder, data, source, count, width)
        return context.get_dummy_value()

    return (types.void(of, to), code) if _alike(of, to) else None


@lowered(_copy_plainly)
def copy_first(typing: Any, of: Any, to: Any, n: Any) -> Any:
    """The first n numbers of `to` = the first n of `of`, of the same type of numbers."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source, _, _ = place_of(context, builder, sig.args[0], args[0])
        data, _, width = place_of(context, builder, sig.args[1], args[1])
        cgutils.raw_memcpy(builder, data, source, args[2], width)
        return context.get_dummy_value()

    return (types.void(of, to, types.uint64), code) if _alike(of, to) else None


def _alike(of: Any, to: Any) -> bool:
    """Whether the numbers of two vectors are of one type."""
    one, other = (getattr(each, 'number', None) or each.dtype for each in (of, to))
    return bool(one == other)


@inner
def largest(v: Floats, n: np.uint64) -> float:
    """Largest of the first n numbers, without sign."""
    most = 0.0
    for i in range(n):
        most = max(most, abs(v[i]))
    return most


@inner
def furthest(u: Floats, v: Floats, n: np.uint64) -> float:
    """Largest difference of the first n numbers, without sign."""
    most = 0.0
    for i in range(n):
        most = max(most, abs(u[i] - v[i]))
    return most

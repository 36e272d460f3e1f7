"""Loops over vectors. Slices would do, but their error messages take seconds to compile.

LLVM unrolls a loop, with guards against vectors that overlap: for the few numbers of a small
mechanism such a loop has more instructions than it saves. So `zero` and `copy` call the system's
library, and the other loops take four numbers at a time and then the rest one by one, as they are
written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.block import Block, add, block, largest_of, put, zeros
from alf_ros.kernel.numba_ext.jit import FOUR, ONE, THREE, TWO, ZERO, inlined, inner
from alf_ros.kernel.numba_ext.plain import lowered
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.structs import place_of

FOURS = (0.0, 0.0, 0.0, 0.0)  # the `unit` of blocks of four numbers


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


@inlined
def add_first(of: Floats, to: Floats, n: np.uint64) -> None:
    """to += of, the first n numbers."""
    for i in each(0, n // FOUR):
        add(to, i, block(FOURS, of, i))
    for i in each(n - n % FOUR, n):
        to[i] += of[i]


@inlined
def put_times(weight: float, of: Floats, to: Floats, n: np.uint64) -> None:
    """to = weight of, the first n numbers."""
    for i in each(0, n // FOUR):
        put(to, i, weight * block(FOURS, of, i))
    for i in each(n - n % FOUR, n):
        to[i] = weight * of[i]


@inlined
def add_times(weight: float, of: Floats, to: Floats, n: np.uint64) -> None:
    """to += weight of, the first n numbers."""
    for i in each(0, n // FOUR):
        add(to, i, weight * block(FOURS, of, i))
    for i in each(n - n % FOUR, n):
        to[i] += weight * of[i]


@inlined
def add_two_times(
    weight: float, of: Floats, other_weight: float, other: Floats, to: Floats, n: np.uint64
) -> None:
    """`add_times` twice, with the same bits; it reads and writes `to` once."""
    for i in each(0, n // FOUR):
        first = block(FOURS, to, i) + weight * block(FOURS, of, i)
        put(to, i, first + other_weight * block(FOURS, other, i))
    for i in each(n - n % FOUR, n):
        to[i] = to[i] + weight * of[i] + other_weight * other[i]


@inlined
def put_sum(u: Floats, v: Floats, to: Floats, n: np.uint64) -> None:
    """to = u + v, the first n numbers."""
    for i in each(0, n // FOUR):
        put(to, i, block(FOURS, u, i) + block(FOURS, v, i))
    for i in each(n - n % FOUR, n):
        to[i] = u[i] + v[i]


@inlined
def put_difference(u: Floats, v: Floats, to: Floats, n: np.uint64) -> None:
    """to = u - v, the first n numbers."""
    for i in each(0, n // FOUR):
        put(to, i, block(FOURS, u, i) - block(FOURS, v, i))
    for i in each(n - n % FOUR, n):
        to[i] = u[i] - v[i]


@inner
def largest(v: Floats, n: np.uint64) -> float:
    """Largest of the first n numbers, without sign."""
    four, most = zeros(FOURS), 0.0
    for i in each(0, n // FOUR):
        four = largest_of(four, block(FOURS, v, i))
    for i in each(n - n % FOUR, n):
        most = max(most, abs(v[i]))
    return max(most, largest_coordinate(four))


@inner
def furthest(u: Floats, v: Floats, n: np.uint64) -> float:
    """Largest difference of the first n numbers, without sign."""
    four, most = zeros(FOURS), 0.0
    for i in each(0, n // FOUR):
        four = largest_of(four, block(FOURS, u, i) - block(FOURS, v, i))
    for i in each(n - n % FOUR, n):
        most = max(most, abs(u[i] - v[i]))
    return max(most, largest_coordinate(four))


@inlined
def largest_coordinate(four: Block) -> float:
    """Of a block of four numbers."""
    return max(max(four[ZERO], four[ONE]), max(four[TWO], four[THREE]))

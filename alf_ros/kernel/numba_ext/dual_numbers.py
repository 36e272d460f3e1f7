"""Dual numbers in compiled code: a value, and its slope along one direction.

A function of numbers that is compiled for dual numbers returns its value and its derivative along
the direction in which its arguments change: forward differentiation, exact to rounding (W. K.
Clifford, 1873; Griewank & Walther, Evaluating Derivatives, 2008, ch. 3). Comparisons look at
values, so that the derivative belongs to the branch that is taken. `floor` and whole numbers have
the slope 0 between their steps. A function that is not defined here for dual numbers does not
compile: there is no silent zero.

`Duals` is a pair of pointers, to values and to their slopes, which is read and written as one
vector of dual numbers.

The slope is a number, or `lanes`: slopes along several directions at once, so that the value and
all that depends on it alone is computed once for them.
"""

from __future__ import annotations

import builtins
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from alf_ros.kernel.numba_ext.branch_notes import nearest_whole, plain_value
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.lane_numbers import LanesType, anywhere, pick
from alf_ros.kernel.numba_ext.number_types import (
    PLAIN,
    NumberType,
    PartsType,
    called,
    called_for,
    converted,
    made_of,
)

_NUMBER = 8  # bytes


class DualType(NumberType):
    """A dual number. A number becomes one with the slope 0."""

    parts = ('value', 'slope')

    def __init__(self, slope: Any) -> None:
        super().__init__(f'dual of {slope}', types.float64, slope)


class DualsType(PartsType):
    """Pointers to values and to slopes."""

    parts = ('values', 'slopes')

    def __init__(self, slope: Any) -> None:
        super().__init__(f'duals of {slope}', types.CPointer(types.float64), types.CPointer(slope))


@intrinsic
def dual(typing: Any, value: Any, slope: Any) -> Any:
    """A dual number."""
    return made_of(DualType(slope if isinstance(slope, LanesType) else types.float64))


@intrinsic
def duals(typing: Any, values: Any, slopes: Any) -> Any:
    """A vector of dual numbers, of two pointers."""
    return made_of(DualsType(slopes.dtype))


def _section(typing: Any, pointer: Any, i: Any, x: Any = None) -> Any:
    """Reads number i behind a pointer, or writes x there; lanes begin at any number."""
    number = pointer.dtype

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = builder.gep(args[0], [args[1]])
        if x is None:
            return builder.load(place, align=_NUMBER)
        builder.store(args[2], place, align=_NUMBER)
        return context.get_dummy_value()

    if x is None:
        return number(pointer, types.intp), code
    return types.void(pointer, types.intp, number), code


@intrinsic
def _read(typing: Any, pointer: Any, i: Any) -> Any:
    return _section(typing, pointer, i)


@intrinsic
def _write(typing: Any, pointer: Any, i: Any, x: Any) -> Any:
    return _section(typing, pointer, i, x)


def _some_dual(*kinds: Any) -> DualType | None:
    """The type of dual numbers, if some of these are dual and all others are numbers."""
    found = [kind for kind in kinds if isinstance(kind, DualType)]
    fits = all(isinstance(kind, (*PLAIN, DualType)) for kind in kinds)
    return found[0] if found and fits else None


@intrinsic
def _as_dual(typing: Any, x: Any, other: Any) -> Any:
    """x, or a number with the slope 0, if x or the other number is dual."""
    kind: Any = _some_dual(types.unliteral(x), types.unliteral(other))
    return converted(kind, x, other)


# the rules, each with the functions it is taken for; traced numbers use them too
RULES_OF_TWO: list[tuple[Any, tuple[Any, ...]]] = []
RULES_OF_ONE: list[tuple[Any, tuple[Any, ...]]] = []
COMPARED: list[tuple[Any, tuple[Any, ...]]] = []  # the result is a truth value, or x or y
UNCHANGED: list[tuple[Any, tuple[Any, ...]]] = []  # a whole number, or x


def _binary(rule: Any, *functions: Any, left: Any = None, right: Any = None) -> None:
    """Take `rule`(x, y), of two dual numbers, for these functions; `left` and `right`: the same
    where x or y is a plain number."""
    RULES_OF_TWO.append((rule, functions))
    _take_for_two(rule, functions, left, right)


def _comparison(rule: Callable[..., Any], *functions: Any) -> None:
    """The same of a rule that compares values."""
    COMPARED.append((rule, functions))
    _take_for_two(rule, functions)


def _take_for_two(
    rule: Any, functions: tuple[Any, ...], left: Any = None, right: Any = None
) -> None:
    def matching(x: Any, y: Any) -> Any:
        if not _some_dual(x, y):
            return None
        if left is not None and not isinstance(x, DualType):
            return lambda x, y: left(x, y)
        if right is not None and not isinstance(y, DualType):
            return lambda x, y: right(x, y)
        return lambda x, y: rule(_as_dual(x, y), _as_dual(y, x))

    called_for(*functions)(matching)


def _unary(rule: Callable[..., Any], *functions: Any) -> None:
    """Take `rule`(x), of a dual number, for these functions."""
    RULES_OF_ONE.append((rule, functions))
    _take_for_one(rule, functions)


def _conversion(rule: Callable[..., Any], *functions: Any) -> None:
    """The same of a rule that gives a whole number, or x."""
    UNCHANGED.append((rule, functions))
    _take_for_one(rule, functions)


def _take_for_one(rule: Callable[..., Any], functions: tuple[Any, ...]) -> None:

    def matching(x: Any) -> Any:
        return (lambda x: rule(x)) if isinstance(x, DualType) else None

    called_for(*functions)(matching)


_binary(
    called(lambda x, y: dual(x.value + y.value, x.slope + y.slope)), operator.add, operator.iadd
)
_binary(
    called(lambda x, y: dual(x.value - y.value, x.slope - y.slope)), operator.sub, operator.isub
)
_binary(
    called(lambda x, y: dual(x.value * y.value, x.slope * y.value + x.value * y.slope)),
    operator.mul,
    operator.imul,
    left=called(lambda x, y: dual(x * y.value, y.slope * x)),
    right=called(lambda x, y: dual(x.value * y, x.slope * y)),
)


@called
def _quotient(x: Any, y: Any) -> Any:
    value, factor = x.value / y.value, 1.0 / y.value  # one division for all directions
    return dual(value, (x.slope - value * y.slope) * factor)


_binary(_quotient, operator.truediv, operator.itruediv)


@called
def _power(x: Any, y: Any) -> Any:
    """xʸ: its slope along x is 0 where x is 0 and y > 1; that along y needs x > 0."""
    value, slope = x.value**y.value, 0.0 * x.slope
    if anywhere(x.slope != 0.0):
        along = y.value * x.value ** (y.value - 1.0) * x.slope
        slope = pick(x.slope != 0.0, along, 0.0)
    if anywhere(y.slope != 0.0):
        along = value * math.log(x.value) * y.slope
        slope = slope + pick(y.slope != 0.0, along, 0.0)
    return dual(value, slope)


_binary(_power, operator.pow, operator.ipow, builtins.pow, math.pow)


@called
def _root(x: Any) -> Any:
    """√x; what does not change has the slope 0 at x = 0 too, as in v √v² at rest."""
    value = math.sqrt(x.value)
    return dual(value, pick(x.slope == 0.0, 0.0, x.slope * (0.5 / value)))


@called
def _size(x: Any) -> Any:
    """|x|; its slope at x = 0 is that towards larger x."""
    return dual(-x.value, -x.slope) if x.value < 0.0 else x


@called
def _tanh(x: Any) -> Any:
    value = math.tanh(x.value)
    return dual(value, (1.0 - value * value) * x.slope)


@called
def _exp(x: Any) -> Any:
    value = math.exp(x.value)
    return dual(value, value * x.slope)


@called
def _tan(x: Any) -> Any:
    value = math.tan(x.value)
    return dual(value, (1.0 + value * value) * x.slope)


_unary(_root, math.sqrt, np.sqrt)
_unary(_size, abs, math.fabs, np.abs)
_unary(_tanh, math.tanh, np.tanh)
_unary(_exp, math.exp, np.exp)
_unary(_tan, math.tan, np.tan)
_unary(called(lambda x: dual(-x.value, -x.slope)), operator.neg)
_conversion(called(lambda x: x), operator.pos)
_unary(called(lambda x: dual(math.sin(x.value), math.cos(x.value) * x.slope)), math.sin, np.sin)
_unary(called(lambda x: dual(math.cos(x.value), -math.sin(x.value) * x.slope)), math.cos, np.cos)
_unary(called(lambda x: dual(math.log(x.value), x.slope / x.value)), math.log, np.log)
_unary(
    called(lambda x: dual(math.asin(x.value), x.slope / math.sqrt(1.0 - x.value * x.value))),
    math.asin,
    np.arcsin,
)
_unary(
    called(lambda x: dual(math.atan(x.value), x.slope / (1.0 + x.value * x.value))),
    math.atan,
    np.arctan,
)
_conversion(called(lambda x: int(math.floor(x.value))), math.floor)
_conversion(called(lambda x: int(math.ceil(x.value))), math.ceil)
_conversion(called(lambda x: int(x.value)), int)
_conversion(called(lambda x: nearest_whole(x.value)), nearest_whole)
_conversion(called(lambda x: x.value), plain_value)
_conversion(called(lambda x: x), float)


@called
def _angle(y: Any, x: Any) -> Any:
    square = x.value * x.value + y.value * y.value
    slope = (x.value * y.slope - y.value * x.slope) / square
    return dual(math.atan2(y.value, x.value), slope)


@called
def _hypotenuse(x: Any, y: Any) -> Any:
    value, slope = math.hypot(x.value, y.value), x.value * x.slope + y.value * y.slope
    return dual(value, pick(slope == 0.0, 0.0, slope / value))


_binary(_angle, math.atan2, np.arctan2)
_binary(_hypotenuse, math.hypot, np.hypot)
_comparison(called(lambda x, y: y if y.value > x.value else x), max, np.maximum)
_comparison(called(lambda x, y: y if y.value < x.value else x), min, np.minimum)
_comparison(called(lambda x, y: x.value < y.value), operator.lt)
_comparison(called(lambda x, y: x.value <= y.value), operator.le)
_comparison(called(lambda x, y: x.value > y.value), operator.gt)
_comparison(called(lambda x, y: x.value >= y.value), operator.ge)
_comparison(called(lambda x, y: x.value == y.value), operator.eq)
_comparison(called(lambda x, y: x.value != y.value), operator.ne)


@called_for(plus_product)
def _plus_product(total: Any, factor: Any, x: Any) -> Any:
    if _some_dual(total, factor, x):
        return lambda total, factor, x: total + factor * x
    return None


@called_for(operator.getitem)
def _get(v: Any, i: Any) -> Any:
    if not isinstance(v, DualsType):
        return None
    return lambda v, i: dual(v.values[i], _read(v.slopes, i))


@called_for(operator.setitem)
def _set(v: Any, i: Any, x: Any) -> Any:
    if not isinstance(v, DualsType):
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        number = _as_dual(x, dual(0.0, _read(v.slopes, i)))
        v.values[i] = number.value
        _write(v.slopes, i, number.slope)

    return put

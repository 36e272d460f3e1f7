"""Traced numbers in compiled code: a value, and its slope along one number of a trace.

A function of numbers that is compiled for traced numbers returns its values, and writes operations
down: on which two numbers each was done, and its derivatives by these. Read backwards, this trace
gives the derivatives of a weighted sum of all results by all arguments at once: reverse
differentiation, exact to rounding (Griewank & Walther, Evaluating Derivatives, 2008, ch. 3). The
operations are differentiated as with dual numbers (`dual_numbers`), so both agree.

An operation on one number of the trace alone, such as a sine or a product with a constant, changes
the slope and is not written down: most operations of a force are such ones. It is written down if
the slope is not finite. Reading backwards passes over it then where it does not count, as in
v √v² at rest.

The arguments have the first numbers of a trace, operations follow (`traced_words`). `arguments`
makes a vector of arguments, `sums` a vector of results.
"""

from __future__ import annotations

import operator
from typing import Any, ClassVar

import numpy as np
from numba import types
from numba.extending import intrinsic

from alf_ros.kernel.numba_ext.dual_numbers import (
    COMPARED,
    RULES_OF_ONE,
    RULES_OF_TWO,
    UNCHANGED,
    dual,
)
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.number_types import (
    NumberType,
    PartsType,
    called,
    converted,
    inlined,
    inlined_for,
    made_of,
    some,
)
from alf_ros.kernel.numba_ext.traced_words import ARGUMENTS, COUNT, FIRST, ROOM

_FINITE = (operator.add, operator.sub, operator.mul)
_numbers, _words = types.CPointer(types.float64), types.CPointer(types.int64)


class TracedType(NumberType):
    """A traced number. A plain number becomes a constant one: number -1, slope 0."""

    parts = ('value', 'number', 'slope', 'words', 'slopes')
    plain: ClassVar = {'number': -1}

    def __init__(self) -> None:
        super().__init__('traced', types.float64, types.int64, types.float64, _words, _numbers)


class ArgumentsType(PartsType):
    """Arguments: pointers to their values and to their numbers, -1 for a constant."""

    parts = ('values', 'numbers', 'words', 'slopes')

    def __init__(self) -> None:
        super().__init__('arguments', _numbers, _words, _words, _numbers)


class SumsType(PartsType):
    """Results: pointers to their values, to the numbers that they follow from, and to their slopes
    along these."""

    parts = ('values', 'numbers', 'along', 'words', 'slopes')

    def __init__(self) -> None:
        super().__init__('sums', _numbers, _words, _numbers, _words, _numbers)


TRACED, ARGUMENTS_OF, SUMS = TracedType(), ArgumentsType(), SumsType()


@intrinsic
def _traced(typing: Any, value: Any, number: Any, slope: Any, words: Any, slopes: Any) -> Any:
    return made_of(TRACED)


@intrinsic
def arguments(typing: Any, values: Any, numbers: Any, words: Any, slopes: Any) -> Any:
    """A vector of arguments."""
    return made_of(ARGUMENTS_OF)


@intrinsic
def sums(typing: Any, values: Any, numbers: Any, along: Any, words: Any, slopes: Any) -> Any:
    """A vector of results."""
    return made_of(SUMS)


@intrinsic
def _as_traced(typing: Any, x: Any) -> Any:
    """x, or a constant."""
    return converted(TRACED, x)


@called
def _written(value: Any, x: Any, by_x: Any, other: Any, by_other: Any) -> Any:
    """The value, as the next operation of the trace, on x and a number, or -1; when the trace is
    full, operations are only counted."""
    words, slopes = x.words, x.slopes
    k = words[COUNT]
    words[COUNT] = k + 1
    if k >= words[ROOM]:
        return _traced(value, np.int64(0), 1.0, words, slopes)
    words[FIRST + 2 * k], words[FIRST + 2 * k + 1] = x.number, other
    slopes[2 * k], slopes[2 * k + 1] = by_x, by_other
    return _traced(value, words[ARGUMENTS] + k, 1.0, words, slopes)


@inlined
def _simply(value: Any, x: Any, slope: Any) -> Any:
    """The value, with its slope along the number of x."""
    number = x.number if slope != 0.0 else np.int64(-1)
    return _traced(value, number, slope if number >= 0 else 0.0, x.words, x.slopes)


@inlined
def _following(value: Any, x: Any, slope: Any) -> Any:
    """The same, of an operation that may have infinite slopes."""
    if x.number < 0 or abs(slope) < np.inf:
        return _simply(value, x, slope)
    return _written(value, x, slope, np.int64(-1), 0.0)


def _of_two(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""
    followed = _simply if functions[0] in _FINITE else _following

    @inlined
    def made(x: Any, y: Any) -> Any:
        if (x.number < 0) | (y.number < 0) | (x.number == y.number):
            of = rule(dual(x.value, x.slope), dual(y.value, y.slope))
            return followed(of.value, y if x.number < 0 else x, of.slope)
        of = rule(dual(x.value, x.slope), dual(y.value, 0.0))
        by_y = rule(dual(x.value, 0.0), dual(y.value, y.slope)).slope
        return _written(of.value, x, of.slope, y.number, by_y)

    def matching(x: Any, y: Any) -> Any:
        if not some(TRACED, x, y):
            return None
        return lambda x, y: made(_as_traced(x), _as_traced(y))

    inlined_for(*functions)(matching)


def _of_one(rule: Any, functions: tuple[Any, ...]) -> None:
    @inlined
    def made(x: Any) -> Any:
        of = rule(dual(x.value, x.slope))
        return _following(of.value, x, of.slope)

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if x == TRACED else None

    inlined_for(*functions)(matching)


def _untraced(rule: Any, functions: tuple[Any, ...], count: int) -> None:
    """Take a rule that looks at values, and returns one of its arguments, or something else."""

    def matching_two(x: Any, y: Any) -> Any:
        if not some(TRACED, x, y):
            return None
        return lambda x, y: rule(_as_traced(x), _as_traced(y))

    def matching_one(x: Any) -> Any:
        return (lambda x: rule(x)) if x == TRACED else None

    inlined_for(*functions)(matching_two if count == 2 else matching_one)


for _each, _functions in RULES_OF_TWO:
    _of_two(_each, _functions)
for _each, _functions in RULES_OF_ONE:
    _of_one(_each, _functions)
for _each, _functions in COMPARED:
    _untraced(_each, _functions, 2)
for _each, _functions in UNCHANGED:
    _untraced(_each, _functions, 1)


@inlined
def _sum_of(total: Any, factor: Any, x: Any) -> Any:
    """total + factor x; the usual case, a constant factor, without a look at the product."""
    if factor.number >= 0:
        return total + factor * x
    value = total.value + factor.value * x.value
    slope = factor.value * x.slope
    if slope == 0.0:
        return _traced(value, total.number, total.slope, total.words, total.slopes)
    if total.number < 0:
        return _traced(value, x.number, slope, x.words, x.slopes)
    if total.number == x.number:
        return _traced(value, x.number, total.slope + slope, x.words, x.slopes)
    return _written(value, total, total.slope, x.number, slope)


@inlined_for(plus_product)
def _plus_product(total: Any, factor: Any, x: Any) -> Any:
    if not (some(TRACED, total, factor) or some(TRACED, factor, x)):
        return None
    return lambda total, factor, x: _sum_of(_as_traced(total), _as_traced(factor), _as_traced(x))


@inlined
def _argument(value: Any, number: Any, words: Any, slopes: Any) -> Any:
    return _traced(value, number, 1.0 if number >= 0 else 0.0, words, slopes)


@inlined_for(operator.getitem)
def _get(v: Any, i: Any) -> Any:
    if v == ARGUMENTS_OF:
        return lambda v, i: _argument(v.values[i], v.numbers[i], v.words, v.slopes)
    if v == SUMS:
        return lambda v, i: _traced(v.values[i], v.numbers[i], v.along[i], v.words, v.slopes)
    return None


@inlined_for(operator.setitem)
def _set(v: Any, i: Any, x: Any) -> Any:
    if v != SUMS:
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        number = _as_traced(x)
        v.values[i] = number.value
        v.numbers[i] = number.number
        v.along[i] = number.slope

    return put

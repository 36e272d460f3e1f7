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
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.extending import (
    intrinsic,
    lower_cast,
    make_attribute_wrapper,
    models,
    overload,
    register_model,
)

from alf_ros.kernel.numba_ext.dual_numbers import (
    COMPARED,
    RULES_OF_ONE,
    RULES_OF_TWO,
    UNCHANGED,
    dual,
)
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.traced_words import ARGUMENTS, COUNT, FIRST, ROOM

_FINITE = (operator.add, operator.sub, operator.mul)
_REAL = (types.Float, types.Integer, types.Boolean)
_INLINED = {'error_model': 'numpy', 'forceinline': True}
_OPTIONS: dict[str, Any] = {'strict': False, 'jit_options': _INLINED}
_numbers, _words = types.CPointer(types.float64), types.CPointer(types.int64)


class TracedType(types.Type):
    """A traced number. A plain number becomes a constant one: number -1, slope 0."""

    def __init__(self) -> None:
        super().__init__('traced')

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes a traced number."""
        return Conversion.safe if isinstance(other, _REAL) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if isinstance(other, _REAL) else None


class ArgumentsType(types.Type):
    """Arguments: pointers to their values and to their numbers, -1 for a constant."""

    def __init__(self) -> None:
        super().__init__('arguments')


class SumsType(types.Type):
    """Results: pointers to their values, to the numbers that they follow from, and to their slopes
    along these."""

    def __init__(self) -> None:
        super().__init__('sums')


TRACED, ARGUMENTS_OF, SUMS = TracedType(), ArgumentsType(), SumsType()
_TRACE = [('words', _words), ('slopes', _numbers)]
_PARTS: dict[Any, list[tuple[str, Any]]] = {
    TracedType: [
        ('value', types.float64),
        ('number', types.int64),
        ('slope', types.float64),
        *_TRACE,
    ],
    ArgumentsType: [('values', _numbers), ('numbers', _words), *_TRACE],
    SumsType: [('values', _numbers), ('numbers', _words), ('along', _numbers), *_TRACE],
}


def _modelled(kind: Any) -> None:
    class _Model(models.StructModel):
        def __init__(self, manager: Any, of: Any) -> None:
            super().__init__(manager, of, _PARTS[kind])

    register_model(kind)(_Model)
    for name, _ in _PARTS[kind]:
        make_attribute_wrapper(kind, name, name)


for _kind in _PARTS:
    _modelled(_kind)


def _made(kind: Any) -> Any:
    parts = _PARTS[type(kind)]

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        made = cgutils.create_struct_proxy(kind)(context, builder)
        for (name, _), value in zip(parts, args, strict=True):
            setattr(made, name, value)
        return made._getvalue()

    return kind(*(part for _, part in parts)), code


@intrinsic
def _traced(typing: Any, value: Any, number: Any, slope: Any, words: Any, slopes: Any) -> Any:
    return _made(TRACED)


@intrinsic
def arguments(typing: Any, values: Any, numbers: Any, words: Any, slopes: Any) -> Any:
    """A vector of arguments."""
    return _made(ARGUMENTS_OF)


@intrinsic
def sums(typing: Any, values: Any, numbers: Any, along: Any, words: Any, slopes: Any) -> Any:
    """A vector of results."""
    return _made(SUMS)


@lower_cast(types.Float, TracedType)
@lower_cast(types.Integer, TracedType)
@lower_cast(types.Boolean, TracedType)
def _constant(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
    made = cgutils.create_struct_proxy(to)(context, builder)
    made.value = context.cast(builder, value, of, types.float64)
    made.number = context.get_constant(types.int64, -1)
    made.slope = context.get_constant(types.float64, 0.0)
    made.words = cgutils.get_null_value(made.words.type)
    made.slopes = cgutils.get_null_value(made.slopes.type)
    return made._getvalue()


@intrinsic
def _as_traced(typing: Any, x: Any) -> Any:
    """x, or a constant."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.cast(builder, args[0], sig.args[0], TRACED)

    return TRACED(types.unliteral(x)), code


def _rule(function: Callable[..., Any]) -> Any:
    from numba import njit

    return njit(function, error_model='numpy', forceinline=True)


def _called(function: Callable[..., Any]) -> Any:
    from numba import njit

    return njit(function, error_model='numpy')


@_called
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


@_rule
def _simply(value: Any, x: Any, slope: Any) -> Any:
    """The value, with its slope along the number of x."""
    number = x.number if slope != 0.0 else np.int64(-1)
    return _traced(value, number, slope if number >= 0 else 0.0, x.words, x.slopes)


@_rule
def _following(value: Any, x: Any, slope: Any) -> Any:
    """The same, of an operation that may have infinite slopes."""
    if x.number < 0 or abs(slope) < np.inf:
        return _simply(value, x, slope)
    return _written(value, x, slope, np.int64(-1), 0.0)


def _some_traced(*kinds: Any) -> bool:
    """Whether all are numbers and one of them is traced."""
    return TRACED in kinds and all(kind == TRACED or isinstance(kind, _REAL) for kind in kinds)


def _of_two(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""
    followed = _simply if functions[0] in _FINITE else _following

    @_rule
    def made(x: Any, y: Any) -> Any:
        if (x.number < 0) | (y.number < 0) | (x.number == y.number):
            of = rule(dual(x.value, x.slope), dual(y.value, y.slope))
            return followed(of.value, y if x.number < 0 else x, of.slope)
        of = rule(dual(x.value, x.slope), dual(y.value, 0.0))
        by_y = rule(dual(x.value, 0.0), dual(y.value, y.slope)).slope
        return _written(of.value, x, of.slope, y.number, by_y)

    def matching(x: Any, y: Any) -> Any:
        if not _some_traced(x, y):
            return None
        return lambda x, y: made(_as_traced(x), _as_traced(y))

    for function in functions:
        overload(function, **_OPTIONS)(matching)


def _of_one(rule: Any, functions: tuple[Any, ...]) -> None:
    @_rule
    def made(x: Any) -> Any:
        of = rule(dual(x.value, x.slope))
        return _following(of.value, x, of.slope)

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if x == TRACED else None

    for function in functions:
        overload(function, **_OPTIONS)(matching)


def _untraced(rule: Any, functions: tuple[Any, ...], count: int) -> None:
    """Take a rule that looks at values, and returns one of its arguments, or something else."""

    def matching_two(x: Any, y: Any) -> Any:
        if not _some_traced(x, y):
            return None
        return lambda x, y: rule(_as_traced(x), _as_traced(y))

    def matching_one(x: Any) -> Any:
        return (lambda x: rule(x)) if x == TRACED else None

    for function in functions:
        overload(function, **_OPTIONS)(matching_two if count == 2 else matching_one)


for _each, _functions in RULES_OF_TWO:
    _of_two(_each, _functions)
for _each, _functions in RULES_OF_ONE:
    _of_one(_each, _functions)
for _each, _functions in COMPARED:
    _untraced(_each, _functions, 2)
for _each, _functions in UNCHANGED:
    _untraced(_each, _functions, 1)


@_rule
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


@overload(plus_product, **_OPTIONS)
def _plus_product(total: Any, factor: Any, x: Any) -> Any:
    if not (_some_traced(total, factor) or _some_traced(factor, x)):
        return None
    return lambda total, factor, x: _sum_of(_as_traced(total), _as_traced(factor), _as_traced(x))


@_rule
def _argument(value: Any, number: Any, words: Any, slopes: Any) -> Any:
    return _traced(value, number, 1.0 if number >= 0 else 0.0, words, slopes)


@overload(operator.getitem, **_OPTIONS)
def _get(v: Any, i: Any) -> Any:
    if v == ARGUMENTS_OF:
        return lambda v, i: _argument(v.values[i], v.numbers[i], v.words, v.slopes)
    if v == SUMS:
        return lambda v, i: _traced(v.values[i], v.numbers[i], v.along[i], v.words, v.slopes)
    return None


@overload(operator.setitem, **_OPTIONS)
def _set(v: Any, i: Any, x: Any) -> Any:
    if v != SUMS:
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        number = _as_traced(x)
        v.values[i] = number.value
        v.numbers[i] = number.number
        v.along[i] = number.slope

    return put

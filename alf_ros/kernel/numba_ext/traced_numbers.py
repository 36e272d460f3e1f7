"""Traced numbers in compiled code: a value, and the number of the operation that made it.

A function of numbers that is compiled for traced numbers returns its values, and writes each of
its operations down: on which numbers it was done, and its derivatives by these. Read backwards,
this trace gives the derivatives of a weighted sum of all results by all arguments at once: reverse
differentiation, exact to rounding (Griewank & Walther, Evaluating Derivatives, 2008, ch. 3). The
operations are differentiated as with dual numbers (`dual_numbers`), so both agree.

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
from alf_ros.kernel.numba_ext.traced_words import ARGUMENTS, COUNT, FIRST, ROOM

_REAL = (types.Float, types.Integer, types.Boolean)
_OPTIONS: dict[str, Any] = {'strict': False, 'jit_options': {'error_model': 'numpy'}}
_numbers, _words = types.CPointer(types.float64), types.CPointer(types.int64)


class TracedType(types.Type):
    """A traced number. A plain number becomes a constant one, which no operation made."""

    def __init__(self) -> None:
        super().__init__('traced')

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes a traced number."""
        return Conversion.safe if isinstance(other, _REAL) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if isinstance(other, _REAL) else None


class ArgumentsType(types.Type):
    """Arguments: pointer to their values, and the number of the first."""

    def __init__(self) -> None:
        super().__init__('arguments')


class SumsType(types.Type):
    """Results: pointers to their values, and to the numbers of what made them."""

    def __init__(self) -> None:
        super().__init__('sums')


TRACED, ARGUMENTS_OF, SUMS = TracedType(), ArgumentsType(), SumsType()
_TRACE = [('words', _words), ('slopes', _numbers)]
_PARTS: dict[Any, list[tuple[str, Any]]] = {
    TracedType: [('value', types.float64), ('number', types.int64), *_TRACE],
    ArgumentsType: [('values', _numbers), ('first', types.int64), *_TRACE],
    SumsType: [('values', _numbers), ('numbers', _words), *_TRACE],
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
def _traced(typing: Any, value: Any, number: Any, words: Any, slopes: Any) -> Any:
    return _made(TRACED)


@intrinsic
def arguments(typing: Any, values: Any, first: Any, words: Any, slopes: Any) -> Any:
    """A vector of arguments, the first of them with this number."""
    return _made(ARGUMENTS_OF)


@intrinsic
def sums(typing: Any, values: Any, numbers: Any, words: Any, slopes: Any) -> Any:
    """A vector of results."""
    return _made(SUMS)


@lower_cast(types.Float, TracedType)
@lower_cast(types.Integer, TracedType)
@lower_cast(types.Boolean, TracedType)
def _constant(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
    made = cgutils.create_struct_proxy(to)(context, builder)
    made.value = context.cast(builder, value, of, types.float64)
    made.number = context.get_constant(types.int64, -1)
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

    return njit(function, error_model='numpy')


@_rule
def _written(value: Any, x: Any, by_x: Any, y: Any, by_y: Any) -> Any:
    """The value, as the next operation of the trace, on x and y; when it is full, operations are
    only counted."""
    if x.number < 0 and y.number < 0:
        return _as_traced(value)
    words, slopes = (x.words, x.slopes) if x.number >= 0 else (y.words, y.slopes)
    k = words[COUNT]
    words[COUNT] = k + 1
    if k >= words[ROOM]:
        return _traced(value, np.int64(0), words, slopes)
    words[FIRST + 2 * k], words[FIRST + 2 * k + 1] = x.number, y.number
    slopes[2 * k], slopes[2 * k + 1] = by_x, by_y
    return _traced(value, words[ARGUMENTS] + k, words, slopes)


def _some_traced(*kinds: Any) -> bool:
    """Whether all are numbers and one of them is traced."""
    return TRACED in kinds and all(kind == TRACED or isinstance(kind, _REAL) for kind in kinds)


def _of_two(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""

    @_rule
    def written(x: Any, y: Any) -> Any:
        by_x, by_y = 0.0, 0.0
        value = rule(dual(x.value, 0.0), dual(y.value, 0.0)).value
        if x.number >= 0:
            by_x = rule(dual(x.value, 1.0), dual(y.value, 0.0)).slope
        if y.number >= 0:
            by_y = rule(dual(x.value, 0.0), dual(y.value, 1.0)).slope
        return _written(value, x, by_x, y, by_y)

    def matching(x: Any, y: Any) -> Any:
        if not _some_traced(x, y):
            return None
        return lambda x, y: written(_as_traced(x), _as_traced(y))

    for function in functions:
        overload(function, **_OPTIONS)(matching)


def _of_one(rule: Any, functions: tuple[Any, ...]) -> None:
    @_rule
    def written(x: Any) -> Any:
        of = rule(dual(x.value, 1.0 if x.number >= 0 else 0.0))
        return _written(of.value, x, of.slope, _as_traced(0.0), 0.0)

    def matching(x: Any) -> Any:
        return (lambda x: written(x)) if x == TRACED else None

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


@overload(operator.getitem, **_OPTIONS)
def _get(v: Any, i: Any) -> Any:
    if v == ARGUMENTS_OF:
        return lambda v, i: _traced(v.values[i], v.first + i, v.words, v.slopes)
    if v == SUMS:
        return lambda v, i: _traced(v.values[i], v.numbers[i], v.words, v.slopes)
    return None


@overload(operator.setitem, **_OPTIONS)
def _set(v: Any, i: Any, x: Any) -> Any:
    if v != SUMS:
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        number = _as_traced(x)
        v.values[i] = number.value
        v.numbers[i] = number.number

    return put

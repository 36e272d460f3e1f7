"""Lanes in a function that branches: numbers of members side by side, and a note that they part.

A function of numbers that is compiled for these does for all lanes at once what it does for a
number: each lane has the bits that the function gives for its member alone. A comparison that
holds in all lanes, or in none, is its truth value. Where lanes differ, or their whole numbers do,
the note says so, and the function takes the branches of the member in the first lane: its loops
end, and its indices are in range, where they do for that member. The results are then of no use,
and the function is to be called for one member after another.

`branching` makes a vector of them. Functions that are not defined here do not compile.
"""

from __future__ import annotations

import builtins
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import UnsupportedError
from numba.core.typing.templates import signature
from numba.extending import intrinsic, lower_builtin

from alf_ros.kernel.numba_ext.branch_notes import nearest_whole, plain_value
from alf_ros.kernel.numba_ext.fused_product import plus_product
from alf_ros.kernel.numba_ext.lane_numbers import (
    KNOWN,
    LanesType,
    MaskType,
    anywhere,
    by_parts,
    everywhere,
    lane_by_lane,
    vector_function,
)
from alf_ros.kernel.numba_ext.number_types import (
    PLAIN,
    NumberType,
    PartsType,
    converted,
    inlined,
    inlined_for,
    made_of,
)

_notes = types.CPointer(types.int64)
UNFINISHED, PARTED = 1, 2  # notes; see `finish`
_NUMBER = 8  # bytes
_index = ir.IntType(32)


class BranchingType(NumberType):
    """W numbers, and where it is noted that they part. A plain number has nowhere."""

    parts = ('value', 'note')

    def __init__(self, W: int) -> None:
        super().__init__(f'branching lanes{W}', LanesType(W), _notes)


class BranchingVectorType(PartsType):
    """A pointer to lanes, and where it is noted that they part."""

    parts = ('values', 'note')

    def __init__(self, W: int) -> None:
        super().__init__(f'vector of branching lanes{W}', types.CPointer(LanesType(W)), _notes)


@intrinsic
def _number(typing: Any, value: Any, note: Any) -> Any:
    return made_of(BranchingType(value.W))


@intrinsic
def branching(typing: Any, values: Any, note: Any) -> Any:
    """A vector of such numbers, of a pointer to lanes."""
    return made_of(BranchingVectorType(values.dtype.W))


def _kind_among(*kinds: Any) -> BranchingType | None:
    """The type of these numbers, if some are of it and all others are plain."""
    found = [kind for kind in kinds if isinstance(kind, BranchingType)]
    fits = all(isinstance(kind, (*PLAIN, BranchingType)) for kind in kinds)
    return found[0] if found and fits else None


@intrinsic
def _as_lanes(typing: Any, x: Any, other: Any) -> Any:
    """x, or lanes that all have it, if x or the other number are lanes."""
    kind: Any = _kind_among(types.unliteral(x), types.unliteral(other))
    return converted(kind, x, other)


@intrinsic
def _note_of(typing: Any, x: Any, y: Any) -> Any:
    """The note of one of two numbers that has one."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        notes = [
            cgutils.create_struct_proxy(kind)(context, builder, value=value).note
            for kind, value in zip(sig.args, args, strict=True)
        ]
        return builder.select(cgutils.is_null(builder, notes[0]), notes[1], notes[0])

    return _notes(x, y), code


@intrinsic
def _part(typing: Any, note: Any) -> Any:
    """Note that lanes part. Numbers that were plain have no note: of these no lane differs."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        with builder.if_then(cgutils.is_not_null(builder, args[0]), likely=False):
            builder.store(ir.Constant(ir.IntType(64), PARTED), args[0])
        return context.get_dummy_value()

    return types.void(note), code


@intrinsic
def _first(typing: Any, v: Any) -> Any:
    """The number of the first lane, or its truth value."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = args[0]
        if isinstance(value.type, ir.ArrayType):
            value = builder.extract_value(value, 0)
        value = builder.extract_element(value, _index(0))
        return builder.trunc(value, ir.IntType(1)) if isinstance(v, MaskType) else value

    return (types.boolean if isinstance(v, MaskType) else types.float64)(v), code


@inlined
def _agreed(mask: Any, note: Any) -> Any:
    """A truth value for all lanes; notes where they differ."""
    if everywhere(mask) != anywhere(mask):
        _part(note)
    return _first(mask)


@inlined
def begin(note: Any) -> None:
    """Before a call in lanes: note that it has not come to its end."""
    note[0] = UNFINISHED


@inlined
def finish(note: Any) -> None:
    """After the call. The note is 0 if no lanes have parted and no lane has ended the call by an
    error, as 0.0**-1 does, which would take the results of all others with it."""
    note[0] -= UNFINISHED


def _refused(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    raise UnsupportedError('numbers of several members are not one object')


# numba takes numbers that are equal for one object, and lanes for two
for _sign in (operator.is_, operator.is_not):
    lower_builtin(_sign, BranchingType, BranchingType)(_refused)
    for _plain in PLAIN:
        lower_builtin(_sign, BranchingType, _plain)(_refused)
        lower_builtin(_sign, _plain, BranchingType)(_refused)


# -------------------------------------------------------------------------------- instructions


def _of_two(rule: Any, *functions: Any) -> None:
    """Take `rule`(lanes, lanes) for these functions."""

    @inlined
    def made(x: Any, y: Any) -> Any:
        return _number(rule(x.value, y.value), _note_of(x, y))

    def matching(x: Any, y: Any) -> Any:
        return (lambda x, y: made(_as_lanes(x, y), _as_lanes(y, x))) if _kind_among(x, y) else None

    inlined_for(*functions)(matching)


def _compared(rule: Any, *functions: Any) -> None:
    """Take a rule that gives a mask."""

    @inlined
    def made(x: Any, y: Any) -> Any:
        return _agreed(rule(x.value, y.value), _note_of(x, y))

    def matching(x: Any, y: Any) -> Any:
        return (lambda x, y: made(_as_lanes(x, y), _as_lanes(y, x))) if _kind_among(x, y) else None

    inlined_for(*functions)(matching)


def _of_one(rule: Any, *functions: Any) -> None:
    """Take `rule`(lanes) for these functions."""

    @inlined
    def made(x: Any) -> Any:
        return _number(rule(x.value), x.note)

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if isinstance(x, BranchingType) else None

    inlined_for(*functions)(matching)


def _rounded(name: str) -> Any:
    """An instruction for lanes: 'floor', 'ceil' or 'trunc'."""
    rounding = vector_function(f'llvm.{name}')

    @intrinsic
    def made(typing: Any, v: Any) -> Any:
        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return by_parts(builder, rounding, args[0])

        return v(v), code

    return made


def _whole(name: str, *functions: Any) -> None:
    """Take a rule that gives a whole number, which all lanes must have."""
    rounding = _rounded(name)

    @inlined
    def made(x: Any) -> Any:
        found = rounding(x.value)
        first = _first(found)
        if not everywhere(found == first):
            _part(x.note)
        return int(first)

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if isinstance(x, BranchingType) else None

    inlined_for(*functions)(matching)


_floor = _rounded('floor')

_of_two(inlined(lambda x, y: x + y), operator.add, operator.iadd)
_of_two(inlined(lambda x, y: x - y), operator.sub, operator.isub)
_of_two(inlined(lambda x, y: x * y), operator.mul, operator.imul)
_of_two(inlined(lambda x, y: x / y), operator.truediv, operator.itruediv)
_of_two(inlined(lambda x, y: max(x, y)), max)
_of_two(inlined(lambda x, y: min(x, y)), min)
_compared(inlined(lambda x, y: x < y), operator.lt)
_compared(inlined(lambda x, y: x <= y), operator.le)
_compared(inlined(lambda x, y: x > y), operator.gt)
_compared(inlined(lambda x, y: x >= y), operator.ge)
_compared(inlined(lambda x, y: x == y), operator.eq)
_compared(inlined(lambda x, y: x != y), operator.ne)
_of_one(inlined(lambda x: -x), operator.neg)
_of_one(inlined(lambda x: abs(x)), builtins.abs, math.fabs, np.abs)
_of_one(inlined(lambda x: math.sqrt(x)), math.sqrt, np.sqrt)
_of_one(inlined(lambda x: x), operator.pos, float, plain_value)
_of_one(inlined(lambda x: _floor(x + 0.5)), nearest_whole)
_whole('floor', math.floor)
_whole('ceil', math.ceil)
_whole('trunc', int)


# ------------------------------------------------------------------------------- lane by lane


def _for_each(function: Callable[..., Any], count: int = 1) -> None:
    """Take a function of `count` numbers, which has no instruction, for each lane."""
    if function not in KNOWN:
        lane_by_lane(function, count)
    if count == 1:
        _of_one(inlined(lambda x: function(x)), function)
    else:
        _of_two(inlined(lambda x, y: function(x, y)), function)


for _functions in (math, np):
    for _name in ('sin', 'cos', 'tan', 'tanh', 'exp', 'log'):
        _for_each(getattr(_functions, _name))
for _function in (math.asin, math.atan, np.arcsin, np.arctan):
    _for_each(_function)
for _function in (math.atan2, np.arctan2, math.hypot, np.hypot, np.maximum, np.minimum):
    _for_each(_function, 2)


def _raised(x: Any, y: Any) -> Any:
    return x**y


@intrinsic
def _power(typing: Any, x: Any, y: Any) -> Any:
    """xʸ of each lane, as of its number: a whole y means products."""
    lanes = x if isinstance(x, LanesType) else y

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kinds = [
            types.float64 if isinstance(k, LanesType) else types.unliteral(k) for k in sig.args
        ]
        made = ir.Constant(context.get_value_type(lanes), ir.Undefined)
        for m in range(lanes.W):
            numbers = [
                builder.extract_element(value, _index(m)) if isinstance(kind, LanesType) else value
                for kind, value in zip(sig.args, args, strict=True)
            ]
            one = signature(types.float64, *kinds)
            number = context.compile_internal(builder, _raised, one, numbers)
            made = builder.insert_element(made, number, _index(m))
        return made

    return lanes(x, y), code


@inlined
def _power_of_two(x: Any, y: Any) -> Any:
    return _number(_power(x.value, y.value), _note_of(x, y))


@inlined
def _power_of_lanes(x: Any, y: Any) -> Any:
    return _number(_power(x.value, y), x.note)


@inlined
def _power_of_number(x: Any, y: Any) -> Any:
    return _number(_power(x, y.value), y.note)


@inlined_for(operator.pow, operator.ipow, builtins.pow, math.pow)
def _pow(x: Any, y: Any) -> Any:
    if not _kind_among(x, y):
        return None
    if isinstance(x, PLAIN):
        return lambda x, y: _power_of_number(x, y)
    if isinstance(y, PLAIN):
        return lambda x, y: _power_of_lanes(x, y)
    return lambda x, y: _power_of_two(x, y)


@inlined_for(plus_product)
def _plus_product(total: Any, factor: Any, x: Any) -> Any:
    if not _kind_among(total, factor, x):
        return None
    return lambda total, factor, x: total + factor * x


# ------------------------------------------------------------------------------------- vectors


@intrinsic
def _read(typing: Any, values: Any, i: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(builder.gep(args[0], [args[1]]), align=_NUMBER)

    return values.dtype(values, types.intp), code


@intrinsic
def _write(typing: Any, values: Any, i: Any, x: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], builder.gep(args[0], [args[1]]), align=_NUMBER)
        return context.get_dummy_value()

    return types.void(values, types.intp, values.dtype), code


@inlined_for(operator.getitem)
def _get(v: Any, i: Any) -> Any:
    if not isinstance(v, BranchingVectorType):
        return None
    return lambda v, i: _number(_read(v.values, i), v.note)


@inlined_for(operator.setitem)
def _set(v: Any, i: Any, x: Any) -> Any:
    if not isinstance(v, BranchingVectorType):
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        old = _number(_read(v.values, i), v.note)
        _write(v.values, i, _as_lanes(x, old).value)

    return put

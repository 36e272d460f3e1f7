"""Branch numbers in compiled code: a value, and a note of the branches that were taken by it.

A function of numbers that is compiled for branch numbers does what it does with numbers, and notes
the result of each comparison, and of whatever else jumps with a value: `abs`, `max`, `floor`. Two
places where the notes differ lie on two sides of a branch. Functions that are not defined for dual
numbers are not defined for these.

`watched` makes a vector of arguments, `unread` one of results that nobody reads: the compiler
leaves the part of the function that decides about its branches.
"""

from __future__ import annotations

import builtins
import math
import operator
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from alf_ros.kernel.numba_ext.branch_notes import note_branch
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
    converted,
    inlined,
    inlined_for,
    made_of,
    some,
)

_numbers, _notes = types.CPointer(types.float64), types.CPointer(types.int64)
_SIGNED = (builtins.abs, math.fabs, np.abs)  # rules of one number that jump where it is zero
_FACTOR, _MODULUS = 1_000_003, 2_147_483_647  # of a note, which a double holds exactly


class BranchType(NumberType):
    """A number, and where its branches are noted. A plain number has nowhere."""

    parts = ('value', 'note')
    notes_branches = True

    def __init__(self) -> None:
        super().__init__('branch number', types.float64, _notes)


class WatchedType(PartsType):
    """Arguments: a pointer to their values, and where their branches are noted."""

    parts = ('values', 'note')

    def __init__(self) -> None:
        super().__init__('watched numbers', _numbers, _notes)


class UnreadType(PartsType):
    """Results that nobody reads."""

    parts = ('note',)

    def __init__(self) -> None:
        super().__init__('unread numbers', _notes)


BRANCH, WATCHED, UNREAD = BranchType(), WatchedType(), UnreadType()


@intrinsic
def branch_number(typing: Any, value: Any, note: Any) -> Any:
    """A number whose branches are noted."""
    return made_of(BRANCH)


@intrinsic
def watched(typing: Any, values: Any, note: Any) -> Any:
    """A vector of such numbers."""
    return made_of(WATCHED)


@intrinsic
def unread(typing: Any, note: Any) -> Any:
    """A vector of results that nobody reads."""
    return made_of(UNREAD)


@intrinsic
def new_note(typing: Any) -> Any:
    """Memory of the function that asks, for a note."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = context.get_value_type(types.int64)
        return cgutils.alloca_once_value(builder, kind(1))

    return _notes(), code


@intrinsic
def _as_branch(typing: Any, x: Any) -> Any:
    """x, or a number without a note."""
    return converted(BRANCH, x)


@intrinsic
def _is_noted(typing: Any, x: Any) -> Any:
    """Whether it has a note."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        note = cgutils.create_struct_proxy(BRANCH)(context, builder, value=args[0]).note
        return builder.not_(cgutils.is_null(builder, note))

    return types.boolean(BRANCH), code


@inlined
def _note(x: Any, taken: Any) -> None:
    """Write a whole number down that tells a branch."""
    if _is_noted(x):
        x.note[0] = (x.note[0] * _FACTOR + taken % _MODULUS + 7) % _MODULUS


@inlined
def _noted(x: Any, y: Any) -> Any:
    """The one of two numbers that has a note, if there is one."""
    return x if _is_noted(x) else y


@inlined
def _with(value: Any, x: Any) -> Any:
    return branch_number(value, x.note)


def _of_two(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""

    @inlined
    def made(x: Any, y: Any) -> Any:
        return _with(rule(dual(x.value, 0.0), dual(y.value, 0.0)).value, _noted(x, y))

    def matching(x: Any, y: Any) -> Any:
        return (lambda x, y: made(_as_branch(x), _as_branch(y))) if some(BRANCH, x, y) else None

    inlined_for(*functions)(matching)


def _compared(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take a rule that compares values; it returns a truth value, or one of both."""
    chooses = functions[0] in (max, min)

    @inlined
    def compared(x: Any, y: Any) -> Any:
        found = rule(x, y)
        _note(_noted(x, y), int(found))
        return found

    @inlined
    def chosen(x: Any, y: Any) -> Any:
        found = rule(x, y)
        _note(_noted(x, y), int(x.value < y.value))
        return _with(found.value, _noted(x, y))

    made = chosen if chooses else compared

    def matching(x: Any, y: Any) -> Any:
        return (lambda x, y: made(_as_branch(x), _as_branch(y))) if some(BRANCH, x, y) else None

    inlined_for(*functions)(matching)


def _of_one(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""

    @inlined
    def smooth(x: Any) -> Any:
        return _with(rule(dual(x.value, 0.0)).value, x)

    @inlined
    def signed(x: Any) -> Any:
        _note(x, int(x.value < 0.0))
        return smooth(x)

    made = signed if functions[0] in _SIGNED else smooth

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if x == BRANCH else None

    inlined_for(*functions)(matching)


def _whole(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take a rule that gives a whole number, or the number itself."""

    @inlined
    def rounded(x: Any) -> Any:
        found = rule(x)
        _note(x, found)
        return found

    made = rounded if functions[0] in (math.floor, math.ceil, int) else rule

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if x == BRANCH else None

    inlined_for(*functions)(matching)


for _each, _functions in RULES_OF_TWO:
    _of_two(_each, _functions)
for _each, _functions in COMPARED:
    _compared(_each, _functions)
for _each, _functions in RULES_OF_ONE:
    _of_one(_each, _functions)
for _each, _functions in UNCHANGED:
    _whole(_each, _functions)


@inlined_for(plus_product)
def _plus_product(total: Any, factor: Any, x: Any) -> Any:
    if not some(BRANCH, total, factor, x):
        return None
    return lambda total, factor, x: total + factor * x


@inlined_for(note_branch)
def _note_branch(x: Any, number: Any) -> Any:
    return (lambda x, number: _note(x, number)) if x == BRANCH else None


@inlined_for(operator.getitem)
def _get(v: Any, i: Any) -> Any:
    if v == WATCHED:
        return lambda v, i: branch_number(v.values[i], v.note)
    if v == UNREAD:
        return lambda v, i: branch_number(0.0, v.note)
    return None


@inlined_for(operator.setitem)
def _set(v: Any, i: Any, x: Any) -> Any:
    if v != UNREAD:
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        pass

    return put

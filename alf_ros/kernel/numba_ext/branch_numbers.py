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

from alf_ros.kernel.numba_ext.branch_notes import note_branch
from alf_ros.kernel.numba_ext.dual_numbers import (
    COMPARED,
    RULES_OF_ONE,
    RULES_OF_TWO,
    UNCHANGED,
    dual,
)
from alf_ros.kernel.numba_ext.fused_product import plus_product

_REAL = (types.Float, types.Integer, types.Boolean)
_INLINED = {'error_model': 'numpy', 'forceinline': True}
_OPTIONS: dict[str, Any] = {'strict': False, 'jit_options': _INLINED}
_numbers, _notes = types.CPointer(types.float64), types.CPointer(types.int64)
_SIGNED = (builtins.abs, math.fabs, np.abs)  # rules of one number that jump where it is zero
_FACTOR, _MODULUS = 1_000_003, 2_147_483_647  # of a note, which a double holds exactly


class BranchType(types.Type):
    """A number, and where its branches are noted. A plain number has nowhere."""

    notes_branches = True

    def __init__(self) -> None:
        super().__init__('branch number')

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes a branch number."""
        return Conversion.safe if isinstance(other, _REAL) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if isinstance(other, _REAL) else None


class WatchedType(types.Type):
    """Arguments: a pointer to their values, and where their branches are noted."""

    def __init__(self) -> None:
        super().__init__('watched numbers')


class UnreadType(types.Type):
    """Results that nobody reads."""

    def __init__(self) -> None:
        super().__init__('unread numbers')


BRANCH, WATCHED, UNREAD = BranchType(), WatchedType(), UnreadType()
_PARTS: dict[Any, list[tuple[str, Any]]] = {
    BranchType: [('value', types.float64), ('note', _notes)],
    WatchedType: [('values', _numbers), ('note', _notes)],
    UnreadType: [('note', _notes)],
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
def branch_number(typing: Any, value: Any, note: Any) -> Any:
    """A number whose branches are noted."""
    return _made(BRANCH)


@intrinsic
def watched(typing: Any, values: Any, note: Any) -> Any:
    """A vector of such numbers."""
    return _made(WATCHED)


@intrinsic
def unread(typing: Any, note: Any) -> Any:
    """A vector of results that nobody reads."""
    return _made(UNREAD)


@intrinsic
def new_note(typing: Any) -> Any:
    """Memory of the function that asks, for a note."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = context.get_value_type(types.int64)
        return cgutils.alloca_once_value(builder, kind(1))

    return _notes(), code


@lower_cast(types.Float, BranchType)
@lower_cast(types.Integer, BranchType)
@lower_cast(types.Boolean, BranchType)
def _constant(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
    made = cgutils.create_struct_proxy(to)(context, builder)
    made.value = context.cast(builder, value, of, types.float64)
    made.note = cgutils.get_null_value(made.note.type)
    return made._getvalue()


@intrinsic
def _as_branch(typing: Any, x: Any) -> Any:
    """x, or a number without a note."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.cast(builder, args[0], sig.args[0], BRANCH)

    return BRANCH(types.unliteral(x)), code


@intrinsic
def _is_noted(typing: Any, x: Any) -> Any:
    """Whether it has a note."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        note = cgutils.create_struct_proxy(BRANCH)(context, builder, value=args[0]).note
        return builder.not_(cgutils.is_null(builder, note))

    return types.boolean(BRANCH), code


def _rule(function: Callable[..., Any]) -> Any:
    from numba import njit

    return njit(function, error_model='numpy', forceinline=True)


@_rule
def _note(x: Any, taken: Any) -> None:
    """Write a whole number down that tells a branch."""
    if _is_noted(x):
        x.note[0] = (x.note[0] * _FACTOR + taken % _MODULUS + 7) % _MODULUS


@_rule
def _noted(x: Any, y: Any) -> Any:
    """The one of two numbers that has a note, if there is one."""
    return x if _is_noted(x) else y


@_rule
def _with(value: Any, x: Any) -> Any:
    return branch_number(value, x.note)


def _some(*kinds: Any) -> bool:
    """Whether all are numbers and one of them is a branch number."""
    return BRANCH in kinds and all(kind == BRANCH or isinstance(kind, _REAL) for kind in kinds)


def _take(matching: Callable[..., Any], functions: tuple[Any, ...]) -> None:
    for function in functions:
        overload(function, **_OPTIONS)(matching)


def _of_two(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""

    @_rule
    def made(x: Any, y: Any) -> Any:
        return _with(rule(dual(x.value, 0.0), dual(y.value, 0.0)).value, _noted(x, y))

    def matching(x: Any, y: Any) -> Any:
        return (lambda x, y: made(_as_branch(x), _as_branch(y))) if _some(x, y) else None

    _take(matching, functions)


def _compared(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take a rule that compares values; it returns a truth value, or one of both."""
    chooses = functions[0] in (max, min)

    @_rule
    def compared(x: Any, y: Any) -> Any:
        found = rule(x, y)
        _note(_noted(x, y), int(found))
        return found

    @_rule
    def chosen(x: Any, y: Any) -> Any:
        found = rule(x, y)
        _note(_noted(x, y), int(x.value < y.value))
        return _with(found.value, _noted(x, y))

    made = chosen if chooses else compared

    def matching(x: Any, y: Any) -> Any:
        return (lambda x, y: made(_as_branch(x), _as_branch(y))) if _some(x, y) else None

    _take(matching, functions)


def _of_one(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take the rule of dual numbers for these functions."""

    @_rule
    def smooth(x: Any) -> Any:
        return _with(rule(dual(x.value, 0.0)).value, x)

    @_rule
    def signed(x: Any) -> Any:
        _note(x, int(x.value < 0.0))
        return smooth(x)

    made = signed if functions[0] in _SIGNED else smooth

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if x == BRANCH else None

    _take(matching, functions)


def _whole(rule: Any, functions: tuple[Any, ...]) -> None:
    """Take a rule that gives a whole number, or the number itself."""

    @_rule
    def rounded(x: Any) -> Any:
        found = rule(x)
        _note(x, found)
        return found

    made = rounded if functions[0] in (math.floor, math.ceil, int) else rule

    def matching(x: Any) -> Any:
        return (lambda x: made(x)) if x == BRANCH else None

    _take(matching, functions)


for _each, _functions in RULES_OF_TWO:
    _of_two(_each, _functions)
for _each, _functions in COMPARED:
    _compared(_each, _functions)
for _each, _functions in RULES_OF_ONE:
    _of_one(_each, _functions)
for _each, _functions in UNCHANGED:
    _whole(_each, _functions)


@overload(plus_product, **_OPTIONS)
def _plus_product(total: Any, factor: Any, x: Any) -> Any:
    if not _some(total, factor, x):
        return None
    return lambda total, factor, x: total + factor * x


@overload(note_branch, **_OPTIONS)
def _note_branch(x: Any, number: Any) -> Any:
    return (lambda x, number: _note(x, number)) if x == BRANCH else None


@overload(operator.getitem, **_OPTIONS)
def _get(v: Any, i: Any) -> Any:
    if v == WATCHED:
        return lambda v, i: branch_number(v.values[i], v.note)
    if v == UNREAD:
        return lambda v, i: branch_number(0.0, v.note)
    return None


@overload(operator.setitem, **_OPTIONS)
def _set(v: Any, i: Any, x: Any) -> Any:
    if v != UNREAD:
        return None

    def put(v: Any, i: Any, x: Any) -> None:
        pass

    return put

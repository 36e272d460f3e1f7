"""Numbers of which each member of a study has its own.

A study has thousands of members whose scenes differ in a few numbers. Here such a number is a
`Column`: what computes with it computes for all members at once. The readers of scenes, rows,
masses and effects take columns where they take numbers, so that these members are read in one go,
each with the bits of its own reading. `kernel/numba_ext/lane_numbers.py` is the same for compiled
code.

A comparison of columns is a single truth value. Where members differ in it, they need different
code: `Divided` says which of them the larger part is. Whatever else has no meaning for columns
raises TypeError or ValueError; members are then read one by one. No column has a number that is
not finite.

Arrays of numbers, some of which are columns, are arrays of objects. numpy adds and multiplies
them. Products, norms and pseudoinverses of small arrays are functions here: numpy calls a library
for them, which rounds otherwise than plain sums of products.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Floats

Mask = NDArray[np.bool_]


class Divided(ArithmeticError):
    """Members differ in a truth value. agreeing: (members,) the larger part."""

    def __init__(self, truth: Mask) -> None:
        super().__init__('members differ in more than numbers')
        self.agreeing = truth if 2 * np.count_nonzero(truth) >= truth.size else ~truth


class Column:
    """A number of each member: `values` (members,)."""

    __slots__ = ('values',)

    def __init__(self, values: Floats) -> None:
        self.values = values

    def __add__(self, other: Any) -> Any:
        return _computed(np.add, self, other)

    def __radd__(self, other: Any) -> Any:
        return _computed(np.add, other, self)

    def __sub__(self, other: Any) -> Any:
        return _computed(np.subtract, self, other)

    def __rsub__(self, other: Any) -> Any:
        return _computed(np.subtract, other, self)

    def __mul__(self, other: Any) -> Any:
        return _computed(np.multiply, self, other)

    def __rmul__(self, other: Any) -> Any:
        return _computed(np.multiply, other, self)

    def __truediv__(self, other: Any) -> Any:
        return _computed(np.divide, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _computed(np.divide, other, self)

    def __pow__(self, other: Any) -> Any:
        return (
            NotImplemented if _operands(self, other) is None else each(operator.pow, self, other)
        )

    def __neg__(self) -> Column:
        return Column(-self.values)

    def __pos__(self) -> Column:
        return self

    def __abs__(self) -> Column:
        return Column(np.abs(self.values))

    def __lt__(self, other: Any) -> Any:
        return _compared(np.less, self, other)

    def __le__(self, other: Any) -> Any:
        return _compared(np.less_equal, self, other)

    def __gt__(self, other: Any) -> Any:
        return _compared(np.greater, self, other)

    def __ge__(self, other: Any) -> Any:
        return _compared(np.greater_equal, self, other)

    def __eq__(self, other: Any) -> Any:
        return _compared(np.equal, self, other)

    def __ne__(self, other: Any) -> Any:
        return _compared(np.not_equal, self, other)

    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        return _agreed(self.values != 0.0)


class ColumnText(str):
    """In a document, the text of a number that is a column; no text of its own means anything."""

    column: Any

    def __new__(cls, values: Floats) -> ColumnText:
        """`values` (members,)."""
        found = super().__new__(cls, '#')
        found.column = Column(values)
        return found


def _operands(first: Any, second: Any) -> list[Any] | None:
    """The values of two columns, or of a column and a number; None of anything else."""
    found: list[Any] = []
    for one in (first, second):
        if isinstance(one, Column):
            found.append(one.values)
        elif isinstance(one, (float, int)):
            found.append(float(one))
        else:
            return None
    return found


def _computed(function: Any, first: Any, second: Any) -> Any:
    operands = _operands(first, second)
    if operands is None:
        return NotImplemented
    with np.errstate(all='ignore'):
        return Column(_finite(function(*operands)))


def _finite(values: Floats) -> Floats:
    """These numbers (members,). Raises Divided where some are none: such a member is refused."""
    good = np.isfinite(values)
    if not good.all():
        raise Divided(good)
    return values


def _compared(function: Any, first: Any, second: Any) -> Any:
    operands = _operands(first, second)
    return NotImplemented if operands is None else _agreed(function(*operands))


def _agreed(truth: Mask) -> bool:
    """The truth value of all members. Raises Divided."""
    if truth.all():
        return True
    if truth.any():
        raise Divided(truth)
    return False


def each(function: Callable[..., float], *arguments: Any) -> Any:
    """A function of numbers; of columns for each member. Raises Divided where it raises ValueError
    or ArithmeticError for some of them."""
    members = next((a.values.size for a in arguments if isinstance(a, Column)), 0)
    if not members:
        return function(*arguments)
    rows = zip(*(spread([a], members)[:, 0].tolist() for a in arguments), strict=True)
    found = np.full(members, np.nan)
    for m, row in enumerate(rows):
        with suppress(ValueError, ArithmeticError):
            found[m] = function(*row)
    return Column(_finite(found))


def distance(first: Sequence[Any], second: Sequence[Any]) -> Any:
    """`math.dist`."""
    D = len(first)
    return each(lambda *places: math.dist(places[:D], places[D:]), *first, *second)


# ------------------------------------------------------------------------------------- arrays


def array(values: Any) -> Any:
    """An array of numbers: of floats, or of objects if some are columns."""
    found = np.array(values)
    return found if of_columns(found) else np.asarray(found, dtype=float)


def concatenated(arrays: Sequence[Any]) -> Any:
    """Arrays one behind another, as `array` has them; without any, an empty one."""
    found = np.concatenate(arrays) if arrays else np.zeros(0)
    return found if of_columns(found) else np.asarray(found, dtype=float)


def real(value: Any) -> Any:
    """A number as a Python float; a column as it is."""
    return value if isinstance(value, Column) else float(value)


def of_columns(numbers: Any) -> bool:
    """Whether an array has columns."""
    return bool(numbers.dtype.hasobject)


def spread(numbers: Any, members: int) -> Floats:
    """(members, ...) the numbers of each member, of an array or a list of numbers. Strides of
    transposed arrays stay in their order, on which the rounding of products depends."""
    given = np.asarray(numbers)
    if not of_columns(given):
        return np.broadcast_to(given.astype(float), (members, *given.shape))
    if given.ndim > 1 and given.flags.f_contiguous and not given.flags.c_contiguous:
        return np.swapaxes(spread(given.T, members), -1, -2)
    found = np.empty((members, given.size))
    for n, one in enumerate(given.ravel().tolist()):
        found[:, n] = one.values if isinstance(one, Column) else one
    return found.reshape(members, *given.shape)


def _gathered(numbers: Floats) -> Any:
    """An array of columns from the numbers (members, ...) of each member."""
    good = np.asarray(np.isfinite(numbers.reshape(len(numbers), -1)).all(axis=1))
    if not good.all():
        raise Divided(good)
    found = np.empty(numbers[0].size, dtype=object)
    for n, values in enumerate(numbers.reshape(len(numbers), -1).T):
        found[n] = Column(np.ascontiguousarray(values))
    return found.reshape(numbers.shape[1:]) if numbers.ndim > 1 else found[0]


def dot(first: Any, second: Any) -> Any:
    """The product `@` of vectors, matrices, or stacks of matrices."""
    if not (of_columns(first) or of_columns(second)):
        return first @ second
    members = _members(first, second)
    if not members:
        return array(first.astype(float) @ second.astype(float))
    rank = max(2, first.ndim, second.ndim)
    left, right = (spread(a, members) if of_columns(a) else a[None] for a in (first, second))
    left = left[..., None, :] if first.ndim == 1 else left
    right = right[..., :, None] if second.ndim == 1 else right
    while left.ndim <= rank:  # the axis of the members comes first
        left = left[:, None]
    while right.ndim <= rank:
        right = right[:, None]
    found = np.matmul(left, right)
    found = found[..., 0] if second.ndim == 1 else found
    if first.ndim == 1:
        found = found[..., 0] if second.ndim == 1 else found[..., 0, :]
    return _gathered(found)


def mapped(function: Callable[[Floats], Floats], numbers: Any) -> Any:
    """A function of an array that works along its last axes."""
    members = _members(numbers)
    return _gathered(function(spread(numbers, members))) if members else function(numbers)


def norm(vector: Any) -> Any:
    """The length of a vector."""
    if not of_columns(vector):
        return np.linalg.norm(vector)
    squared = dot(vector, vector)
    return Column(np.sqrt(squared.values)) if isinstance(squared, Column) else np.sqrt(squared)


def pseudoinverse(matrix: Any) -> Any:
    """`numpy.linalg.pinv`."""
    members = _members(matrix)
    if not members:
        return np.asarray(np.linalg.pinv(np.asarray(matrix, dtype=float)), dtype=float)
    return _gathered(np.asarray(np.linalg.pinv(spread(matrix, members)), dtype=float))


def eigenvalues(matrix: Any) -> Any:
    """`numpy.linalg.eigvalsh`."""
    members = _members(matrix)
    if not members:
        return np.linalg.eigvalsh(np.asarray(matrix, dtype=float))
    return _gathered(np.asarray(np.linalg.eigvalsh(spread(matrix, members)), dtype=float))


def largest(numbers: Iterable[Any]) -> Any:
    """The largest of some numbers; 0 without any."""
    every = list(numbers)
    if any(isinstance(one, Column) for one in every):
        return Column(spread(every, _members(np.array(every))).max(axis=1))
    return max(every, default=0.0)


def extent(places: Any) -> Any:
    """How far places (n, D) are apart at most along an axis; 0 without any."""
    members = _members(places)
    if not members:
        return float(np.ptp(places.astype(float), axis=0).max(initial=0.0))
    return Column(np.ptp(spread(places, members), axis=1).max(axis=1))


def _members(*arrays: Any) -> int:
    """How many members columns have; 0 without columns."""
    every = (one for a in arrays if of_columns(a) for one in a.ravel().tolist())
    return next((one.values.size for one in every if isinstance(one, Column)), 0)

"""Structs: compiled code reads and writes the arrays that Python sees."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from alf_ros.arrays import Floats, Indices, Integers, Unit
from alf_ros.kernel.numba_ext.structs import Struct, vector


@dataclass(frozen=True, eq=False)
class Table(Struct):
    constant = True

    where: Indices
    factor: float
    limit: np.uint64


@dataclass(frozen=True, eq=False)
class Sums(Struct):
    table: Table
    total: Floats
    count: Integers


@dataclass(frozen=True, eq=False)
class Space(Struct):
    before: Integers
    unit: Unit
    sums: Sums
    scale: float


@njit
def scaled(space):
    space.before[0] = len(space.unit)
    return space.scale * len(space.unit) * space.sums.total.size, space.unit


@njit
def add(sums, values):
    values = vector(values)
    table = sums.table
    for n in range(table.where.size):
        if table.where[n] < table.limit:
            sums.total[table.where[n]] += table.factor * values[n]
            sums.count[0] -= 1
    return values.size


@njit
def spoil(table):
    table.where[0] = 1


def sums() -> Sums:
    where = np.array([2, 0, 5, 2], dtype=np.uint32)
    return Sums(Table(where, -0.5, np.uint64(3)), np.zeros(3), np.zeros(1, dtype=np.int64))


def test_compiled_code_works_on_the_arrays_of_python() -> None:
    s = sums()
    assert add(s, np.array([[1.0, 2.0], [4.0, 8.0]])) == 4
    assert s.total.tolist() == [-1.0, 0.0, -4.5] and s.count.tolist() == [-3]


def test_a_replaced_part_is_another_struct() -> None:
    s = sums()
    other = replace(s, table=replace(s.table, factor=2.0))
    assert vars(other)['_address'] != vars(s)['_address']
    add(other, np.ones(4))
    assert other.total.tolist() == [2.0, 0.0, 4.0]
    assert other.total is s.total  # what was not replaced is shared


def test_constants_cannot_be_written() -> None:
    with pytest.raises(TypingError):
        spoil(sums().table)


@pytest.mark.parametrize(
    'where', [np.array([1, 2]), np.array([1.0]), np.zeros((4, 4), dtype=np.uint32)[:, 1]]
)
def test_an_array_of_another_kind_is_refused(where: Indices) -> None:
    with pytest.raises(TypeError, match='Table.where'):
        replace(sums().table, where=where)


@pytest.mark.parametrize('D', [2, 3])
def test_the_dimension_is_a_part_of_the_type(D: int) -> None:
    """The dimension occupies no memory: the fields after it in the struct keep their offsets."""
    before = np.zeros(1, dtype=np.int64)
    space = Space(before, (0.0,) * D, sums(), 0.5)
    assert scaled(space) == (1.5 * D, (0.0,) * D)
    assert before[0] == D
    assert space._numba_type(2) != space._numba_type(3)
    view: Any = space._view()  # without a compiler
    assert view.unit == space.unit and view.scale == 0.5

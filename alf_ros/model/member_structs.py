"""Structs of many members of one structure: the numbers in which they differ stand in rows of one
array, everything else exists once.

A study has thousands of members. To make the structs of each by itself costs more than its steps;
here the tables of all are written by a few operations on arrays. Members side by side, as
`LaneStruct` has them, are arrays of these arrays.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Addresses
from alf_ros.kernel.numba_ext.lane_numbers import LanesType
from alf_ros.kernel.numba_ext.lane_structs import LaneStruct, lane_type, value_in_lanes
from alf_ros.kernel.numba_ext.structs import Struct, StructType, VectorType

_LINE = 64  # bytes, of the cache

Array = NDArray[Any]


class Located:
    """A struct of compiled code that stands somewhere in a table of others."""

    def __init__(self, kind: StructType, address: int) -> None:
        self._numba_type_, self._address = kind, address


class MemberStructs:
    """Structs as `like`, one for each member.

    own: the parts that each member has itself, by their names ('system.mass.k'), of structs with
    all that is in them, except those `shared`. They are attributes: arrays (members, numbers), of
    a number (members,), and structs of members. At first each has the values of `like`.
    """

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def __init__(
        self,
        like: Struct,
        members: int,
        own: Collection[str],
        shared: Collection[str] = (),
        within: str = '',
    ) -> None:
        self.like, self.members = like, members
        self.addresses: Addresses
        self.parts: dict[str, Any] = {}
        self._table = np.tile(like._table, (members, 1))
        self._kind: StructType = vars(like)['_numba_type_']
        for name, word, part in self._kind.parts:
            path, value = within + name, getattr(like, name)
            if isinstance(part, StructType):
                if _touches(path, own):
                    inner = MemberStructs(value, members, own, shared, path + '.')
                    self._table[:, word], self.parts[name] = inner.addresses, inner
            elif _is_in(path, own) and not _is_in(path, shared) and name != 'unit':
                self.parts[name] = self._own(word, part, value)
        vars(self).update(self.parts)
        self.addresses = _row_addresses(self._table)

    def _own(self, word: int, part: Any, value: Any) -> Array:
        if not isinstance(part, VectorType):
            numbers = self._table.view(np.float64)[:, word]
            return np.asarray(numbers)
        rows = np.empty((self.members, value.size), dtype=value.dtype)
        rows[:] = value.reshape(-1)
        self._table[:, word] = _row_addresses(rows)
        return rows

    def member(self, m: int) -> Located:
        """The struct of member m, for compiled code."""
        return Located(self._kind, int(self.addresses[m]))


class LanesOfMembers:
    """The structs of members in groups of `lanes`, as `LaneStruct` has one group; the number of
    members is a multiple of `lanes`.

    Numbers of members are copies: `take` copies them again. Attributes as of `MemberStructs`:
    arrays (groups, numbers, lanes).
    """

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def __init__(self, members: MemberStructs, lanes: int) -> None:
        like, self._lanes = members.like, lanes
        self._groups = members.members // lanes
        self.addresses: Addresses
        D = len(getattr(like, 'unit', ()))
        self._kind = lane_type(type(like), D, lanes)
        self._copied: list[tuple[Array, Array]] = []  # in lanes; (members, numbers)
        self._inner: list[LanesOfMembers] = []
        self._kept: list[Any] = []
        words = list(_columns(self._kind, lambda part, name: self._part(members, part, name)))
        self._table = np.stack(words, axis=1)
        self.addresses = _row_addresses(self._table)

    def _part(self, members: MemberStructs, part: Any, name: str) -> tuple[Addresses, int]:
        """(groups,) the address or value in a field, and the size of its array."""
        value, own = getattr(members.like, name), members.parts.get(name)
        if isinstance(part, StructType):
            if own is not None:
                inner = LanesOfMembers(own, self._lanes)
                self._inner.append(inner)
                setattr(self, name, inner)
                return inner.addresses, 0
            if not type(value).common:
                value = LaneStruct([value] * self._lanes)
            self._kept.append(value)
            return self._same(value._address), 0
        if isinstance(part, (VectorType, LanesType)) and value_in_lanes(part):
            numbers = np.asarray(value, dtype=float).reshape(-1)
            array = _aligned(self._groups, numbers.size, self._lanes)
            array[:] = numbers[:, None]
            if own is not None:
                self._copied.append((array, own.reshape(members.members, -1)))
            setattr(self, name, array)
            return _row_addresses(array), numbers.size
        if isinstance(part, VectorType):
            if own is None:
                return self._same(value.ctypes.data), value.size
            rows = np.tile(value.reshape(-1), (self._groups, 1))
            setattr(self, name, rows)
            return _row_addresses(rows), value.size
        return self._same(int(value)), 0

    def _same(self, word: int) -> Addresses:
        return np.full(self._groups, word, dtype=np.uint64)

    def take(self) -> None:
        """Copy the numbers of the members again."""
        for array, rows in self._copied:
            of_groups = rows.reshape(self._groups, self._lanes, -1)
            array[:] = of_groups.transpose(0, 2, 1)
        for inner in self._inner:
            inner.take()

    def columns(self, without: str = '') -> list[Array]:
        """Its arrays (groups, numbers, lanes) of numbers of members, and the arrays of structs in
        it but one."""
        found = [array for array, _ in self._copied]
        for inner in self._inner:
            if inner is not vars(self).get(without):
                found += inner.columns()
        return found

    def group(self, g: int) -> Located:
        """The struct of a group, for compiled code."""
        return Located(self._kind, int(self.addresses[g]))


def _columns(kind: StructType, part_of: Any) -> Iterator[Addresses]:
    """The words of the tables of all groups, column by column."""
    for name, _, part in kind.parts:
        if name != 'unit':
            words, size = part_of(part, name)
            yield words
            if isinstance(part, VectorType):
                yield np.full(words.size, size, dtype=np.uint64)


def _is_in(path: str, names: Collection[str]) -> bool:
    """Whether a part is one of these, or within one."""
    return any(path == name or path.startswith(f'{name}.') for name in names)


def _touches(path: str, names: Collection[str]) -> bool:
    """Whether a struct is one of these, within one, or has one in it."""
    return _is_in(path, names) or any(name.startswith(f'{path}.') for name in names)


def _row_addresses(rows: Array) -> Addresses:
    """Where each row of an array begins."""
    first = np.uint64(rows.ctypes.data)
    return first + np.arange(len(rows), dtype=np.uint64) * np.uint64(rows.strides[0])


def _aligned(groups: int, numbers: int, lanes: int) -> Array:
    """(groups, numbers, lanes) zeros where lines of the cache begin."""
    room = np.zeros(groups * numbers * lanes + _LINE // 8)
    begin = (-room.ctypes.data % _LINE) // 8
    return room[begin : begin + groups * numbers * lanes].reshape(groups, numbers, lanes)

"""Structs whose numbers belong to several members side by side: see `lane_numbers`.

`LaneStruct` is made of structs of one class. Whole numbers are the pattern, which all members
share; fields that a class names in `counted` are numbers of each member too, and a class that is
`common` is shared as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.lane_numbers import LanesType
from alf_ros.kernel.numba_ext.plain import flat, lowered
from alf_ros.kernel.numba_ext.structs import Struct, StructType, VectorType, element

_LINE = 64  # bytes, of the cache: a register of 8 lanes is one
_types: dict[tuple[type[Struct], int, int], StructType] = {}


def lane_type(cls: type[Struct], D: int, W: int) -> StructType:
    """The type of a `LaneStruct` of structs of a class, D the length of its `unit`."""
    if (cls, D, W) not in _types:
        parts, word = [], 0
        for name, _, part in cls._numba_type(D).parts:
            hint = cls._hints()[name]
            if name in cls.counted or (
                isinstance(part, VectorType) and part.number == types.float64
            ):
                part = VectorType(LanesType(W), cls.constant)
            elif part == types.float64:
                part = LanesType(W)
            elif isinstance(part, StructType) and not hint.common:
                part = lane_type(hint, D if _has_unit(hint) else 0, W)
            parts.append((name, word, part))
            if name != 'unit':
                word += 2 if isinstance(part, VectorType) else 1
        name = f'{W} {cls._numba_type(D).name}'
        _types[cls, D, W] = StructType(name, tuple(parts))
    return _types[cls, D, W]


def _has_unit(cls: type[Struct]) -> bool:
    return any(field.name == 'unit' for field in fields(cls))


class LaneStruct:
    """Structs of one class side by side: arrays (numbers, W), a copy; patterns are the first's."""

    _table: Any
    _address: int

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def __init__(self, members: Sequence[Struct]) -> None:
        first, W = members[0], len(members)
        self._numba_type_ = lane_type(type(first), len(getattr(first, 'unit', ())), W)
        words: list[int] = []
        for name, _, part in self._numba_type_.parts:
            value: Any = getattr(first, name)
            if isinstance(part, (VectorType, LanesType)) and value_in_lanes(part):
                value = _side_by_side([getattr(member, name) for member in members])
                words.append(value.ctypes.data)
                if isinstance(part, VectorType):
                    words.append(len(value))
            elif isinstance(part, VectorType):
                if not type(first).constant:
                    value = value.copy()
                words += (value.ctypes.data, value.size)
            elif isinstance(part, StructType):
                if not type(value).common:
                    value = LaneStruct([getattr(member, name) for member in members])
                words.append(value._address)
            elif name != 'unit':
                words.append(int(value))
            setattr(self, name, value)
        self._table = np.array(words, dtype=np.uint64)
        self._address = self._table.ctypes.data

    def columns(self, without: str = '') -> list[Floats]:
        """Its arrays (numbers, W), and the arrays of structs in it but one; each once."""
        found = []
        for name, _, part in self._numba_type_.parts:
            value = getattr(self, name)
            if isinstance(value, LaneStruct):
                found += value.columns() if name != without else []
            elif isinstance(part, (VectorType, LanesType)) and value_in_lanes(part):
                found.append(value)
        return found


def value_in_lanes(part: Any) -> bool:
    """Whether a field holds numbers of each member."""
    return isinstance(part, LanesType) or isinstance(part.number, LanesType)


def _side_by_side(values: Sequence[Any]) -> Floats:
    """(numbers, W) where lines of the cache begin."""
    array = aligned(np.asarray(values[0]).size, len(values))
    for m, value in enumerate(values):
        array[:, m] = np.asarray(value).reshape(-1)
    return array


def aligned(size: int, W: int) -> Floats:
    """(size, W) zeros, where a line of the cache begins."""
    room = np.zeros(size * W + _LINE // 8)
    begin = (-room.ctypes.data % _LINE) // 8
    return room[begin : begin + size * W].reshape(size, W)


@intrinsic
def struct_at(typing: Any, like: Any, address: Any) -> Any:
    """The struct at an address, of the type of another."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.inttoptr(args[1], args[0].type)

    return like(like, types.uint64), code


@intrinsic
def lanes_at(typing: Any, like: Any, address: Any, size: Any) -> Any:
    """So many numbers at an address, in lanes as another vector."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        made = cgutils.create_struct_proxy(sig.return_type)(context, builder)
        made.data = builder.inttoptr(args[1], made.data.type)
        made.size = args[2]
        return made._getvalue()

    return like(like, types.uint64, types.uint64), code


def _lane(context: Any, builder: Any, kind: Any, args: Any) -> Any:
    """Where number args[1] of the member in lane args[2] stands."""
    pointer = element(context, builder, kind, args[0], args[1])
    numbers = builder.bitcast(pointer, ir.DoubleType().as_pointer())
    return builder.gep(numbers, [args[2]])


@intrinsic
def lane(typing: Any, v: Any, i: Any, m: Any) -> Any:
    """Number i of v, of the member in lane m."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_lane(context, builder, sig.args[0], args))

    return types.float64(v, types.uint64, types.uint64), code


@intrinsic
def set_lane(typing: Any, v: Any, i: Any, m: Any, x: Any) -> Any:
    """Number i of v, of the member in lane m, = x."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[3], _lane(context, builder, sig.args[0], args[:3]))
        return context.get_dummy_value()

    return types.void(v, types.uint64, types.uint64, types.float64), code


@intrinsic
def lanes_of(typing: Any, v: Any) -> Any:
    """W of a vector of lanes."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return ir.IntType(64)(sig.args[0].number.W)

    return types.uint64(v), code


def _plain_section(v: Any, first: Any, size: Any) -> Any:
    return flat(v.array[int(first) : int(first) + int(size)])


@lowered(_plain_section)
def section(typing: Any, v: Any, first: Any, size: Any) -> Any:
    """So many numbers of a vector, from number `first` on."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = sig.return_type
        made = cgutils.create_struct_proxy(kind)(context, builder)
        made.data, made.size = element(context, builder, kind, args[0], args[1]), args[2]
        return made._getvalue()

    return v(v, types.uint64, types.uint64), code

"""Structs of compiled code, made at little cost.

A `Struct` examines every array that it is made of. Here the arrays of a workspace are cut from one
piece of memory, so their places follow from one address; and of a struct with a few other parts
only those parts are examined.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cache
from typing import Any, Generic, TypeVar

import numpy as np
from numba.np.numpy_support import as_dtype

from alf_ros.kernel.numba_ext.structs import Struct, StructType, VectorType, _word_of

S = TypeVar('S', bound=Struct)

# by the types of structs, which live as long as the process; to hash one calls Python
_PLACES: dict[int, dict[str, tuple[int, Any]]] = {}
_NOTHING = ctypes.c_char * 0
_WORD = 8  # bytes, of each number in a workspace
_ALIGNED = 2  # words: where memory of its own would begin


class StructMemory(Generic[S]):
    """Memory for structs of one kind, whose arrays have these sizes: `sizes` by name.

    Raises TypeError for a kind with numbers of another length than 64 bits among them.
    """

    def __init__(self, kind: type[S], sizes: Mapping[str, int]) -> None:
        self._kind, self._type = kind, kind._numba_type()
        self._arrays: list[tuple[str, int, int, Any]] = []
        places, self._table = [], np.zeros(_words(self._type), dtype=np.uint64)
        at = 0
        for name, word, part in self._type.parts:
            if name not in sizes:
                continue
            dtype = _numbers(part)
            if dtype.itemsize != _WORD:
                raise TypeError(f'{kind.__name__}.{name}: numbers of {dtype}')
            of = None if dtype == np.float64 else dtype
            self._arrays.append((name, at, at + sizes[name], of))
            self._table[word], self._table[word + 1] = at * _WORD, sizes[name]
            places.append(word)
            at += -(-sizes[name] // _ALIGNED) * _ALIGNED
        self._places, self._size = np.array(places), at

    def zeros(self, **parts: Struct) -> S:
        """A new one, zero everywhere; `parts`: its structs by name."""
        memory, table = np.zeros(self._size), self._table.copy()
        table[self._places] += np.uint64(_address(memory))
        fields: dict[str, Any] = {}
        for name, start, end, dtype in self._arrays:
            array = memory[start:end]
            fields[name] = array if dtype is None else array.view(dtype)
        return _made(self._kind, fields, table, self._type, parts)


def changed(struct: S, **parts: Any) -> S:
    """The struct with other arrays, numbers and structs, by name: it shares the rest.

    As `dataclasses.replace`, which examines all parts again. Raises TypeError for an array of
    another type.
    """
    fields = vars(struct).copy()
    fields.pop('_plain', None)
    return _made(type(struct), fields, struct._table.copy(), fields['_numba_type_'], parts)


def made(kind: type[S], **parts: Any) -> S:
    """The struct of these parts, by name: arrays, numbers and structs. As `kind(**parts)`."""
    of = kind._numba_type()
    return _made(kind, {}, np.zeros(_words(of), dtype=np.uint64), of, parts)


def frozen(struct: S) -> S:
    """The struct, whose own arrays are read-only from now on."""
    for part in vars(struct).values():
        if isinstance(part, np.ndarray):
            part.setflags(write=False)
    return struct


def _made(
    kind: type[S], fields: dict[str, Any], table: Any, of: StructType, parts: Mapping[str, Any]
) -> S:
    """A struct of these fields, with the words of its `parts` put into the table."""
    words = _word_at(of)
    for name, value in parts.items():
        word, dtype = words[name]
        fields[name] = value
        if dtype is None:
            table[word] = _word_of(value)
            continue
        if value.dtype != dtype or not value.flags.c_contiguous:
            raise TypeError(f'{kind.__name__}.{name} is no array of {dtype}')
        table[word], table[word + 1] = _address(value), value.size
    fields['_table'], fields['_address'], fields['_numba_type_'] = table, _address(table), of
    found = object.__new__(kind)
    vars(found).update(fields)
    return found


def _word_at(of: StructType) -> dict[str, tuple[int, Any]]:
    """The first word of each field, and the type of its numbers if it is an array."""
    found = _PLACES.get(id(of))
    if found is None:
        dtypes = dict(of.words)
        found = {name: (word, dtypes[name]) for name, word, _ in of.parts if name in dtypes}
        _PLACES[id(of)] = found
    return found


def _address(array: np.ndarray[Any, Any]) -> int:
    """Where the numbers of an array are. `ctypes.data` takes four times as long."""
    if array.flags.writeable:
        return ctypes.addressof(_NOTHING.from_buffer(array.data))
    return int(array.ctypes.data)


@cache
def _words(of: StructType) -> int:
    return sum(2 if isinstance(part, VectorType) else 1 for _, _, part in of.parts)


def _numbers(part: Any) -> Any:
    return as_dtype(part.number)

"""Structs of arrays that compiled code takes as one pointer.

numba hands an array on as seven words, and a tuple of arrays as seven words for each: with the
arrays of a mechanism that costs more than its mechanics, in every step and in compiling it. A
`Struct` keeps its arrays in Python, beside a table of their addresses and sizes; compiled code
gets the address of the table, reads `struct.name[i]` and `struct.name.size`, and writes
`struct.name[i]`. Nothing counts references, checks bounds or wraps negative indices: as with any
argument, the struct outlives the call.

The arrays of a `constant` struct are not written while compiled code runs, so that what it has
read once it need not read again.

A struct in a struct is one word, the address of its table: `problem.system.rows` costs two loads,
which LLVM makes once in a function. A field `unit`, a tuple as long as space has dimensions, takes
no word: it is a part of the type, so that D is a constant when compiled. A struct that holds one
with a `unit` has the same `unit`.

Arrays (numbers, W) of a field `Lanes` are vectors of numbers of W lanes; W is a part of the type
too, and the same in all that a struct holds.

A copy has arrays of its own, and so has an unpickled struct: the table is made again. Addresses of
code and of Python objects are of one process: a struct that holds some is not pickled, but made
again by its owner.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields
from functools import partial
from typing import (
    Annotated,
    Any,
    ClassVar,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import (
    NativeValue,
    lower_builtin,
    lower_cast,
    lower_getattr_generic,
    make_attribute_wrapper,
    models,
    register_model,
    unbox,
)
from numba.np.numpy_support import as_dtype

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.lane_numbers import LanesType
from alf_ros.kernel.numba_ext.plain import PLAIN, View, flat, lowered, structs

S = TypeVar('S', bound='Struct')
Lanes: TypeAlias = Annotated[Floats, 'lanes']  # (numbers, W), each number of W lanes

_SCALARS = {np.uint64: types.uint64, float: types.float64}
_word = ir.IntType(64)
_NUMBER = 8  # bytes: lanes may begin at any number, although the start of a line is faster


class VectorType(types.Type):
    """A pointer to numbers and how many they are; `constant` if nobody writes them."""

    def __init__(self, number: types.Number | LanesType, constant: bool) -> None:
        self.number, self.constant = number, constant
        super().__init__(f'{"const " if constant else ""}{number}*')

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether this is the vector of an array."""
        return Conversion.safe if common_type(other) == self else None


def common_type(kind: types.Type) -> types.Type:
    """The type in which compiled functions take an argument: a constant as any value of its type,
    whole numbers in 64 bit, the numbers of an array as a vector."""
    kind = types.unliteral(kind)
    if isinstance(kind, types.Integer):
        return types.int64 if kind.signed else types.uint64
    if isinstance(kind, types.Array) and (kind.ndim, kind.layout, kind.mutable) == (1, 'C', True):
        return VectorType(kind.dtype, False)
    return kind


def _dtype(part: types.Type) -> Any:
    """Of an array in a field; None of other fields."""
    if not isinstance(part, VectorType):
        return None
    return as_dtype(types.float64 if isinstance(part.number, LanesType) else part.number)


def _lanes_of(part: types.Type) -> int:
    """How many numbers of an array in a field are one in compiled code."""
    number = getattr(part, 'number', None)
    return number.W if isinstance(number, LanesType) else 1


class StructType(types.Type):
    """A pointer to a table of words; `parts`: (name, first word, type) of each field. `words`: the
    fields that have words, with the dtype of those that are arrays; `lanes`: how many of their
    numbers are one in compiled code."""

    def __init__(self, name: str, parts: tuple[tuple[str, int, types.Type], ...]) -> None:
        self.parts = parts
        self.words = tuple(
            (name, _dtype(part)) for name, _, part in parts if not isinstance(part, types.UniTuple)
        )
        self.lanes = {name: _lanes_of(part) for name, _, part in parts}
        super().__init__(name)


@dataclass(frozen=True, eq=False)
class Struct:
    """Base of structs: frozen dataclasses of arrays, numbers (float, np.uint64) and structs.

    The length of a field `unit` is the dimension of space. `addresses`: the fields that hold
    addresses; `borrowed`: fields among these that a copy does not have. Raises TypeError for an
    array of another type than annotated, or one that is not contiguous.
    """

    constant: ClassVar[bool] = False
    common: ClassVar[bool] = False
    counted: ClassVar[tuple[str, ...]] = ()
    addresses: ClassVar[tuple[str, ...]] = ()
    borrowed: ClassVar[tuple[str, ...]] = ()
    _table: ClassVar[Any]
    _address: ClassVar[int]
    _numba_type_: ClassVar[Any]
    _types: ClassVar[dict[tuple[type[Struct], int, int], StructType]] = {}
    _evaluated: ClassVar[dict[type[Struct], dict[str, Any]]] = {}
    _first_lanes: ClassVar[dict[type[Struct], tuple[str, ...]]] = {}
    _nothing: ClassVar[dict[type[Struct], tuple[Callable[[], Any], ...]]] = {}

    def __post_init__(self) -> None:
        kind = self._numba_type(len(getattr(self, 'unit', ())), self._lanes())
        words: list[int] = []
        for name, dtype in kind.words:
            value = getattr(self, name)
            if dtype is None:
                words.append(_word_of(value))
                continue
            if value.dtype != dtype or not value.flags.c_contiguous:
                raise TypeError(f'{type(self).__name__}.{name} is no array of {dtype}')
            words += (value.__array_interface__['data'][0], value.size // kind.lanes[name])
        table = np.array(words, dtype=np.uint64)
        for name, value in (
            ('_table', table),
            ('_address', table.ctypes.data),
            ('_numba_type_', kind),  # where numba looks for the type of an argument
        ):
            object.__setattr__(self, name, value)

    def __copy__(self: S) -> S:
        return type(self)(*(self._own(field.name) for field in fields(self)))

    def __deepcopy__(self: S, memo: object) -> S:
        return self.__copy__()

    def _own(self, name: str) -> Any:
        value = getattr(self, name)
        if name in self.borrowed:
            return np.zeros_like(value)
        return copy(value) if isinstance(value, (Struct, np.ndarray)) else value

    def __reduce__(self) -> tuple[Any, ...]:
        """Its arrays and numbers. Raises TypeError if there are addresses among them."""
        if any(getattr(self, name).any() for name in self.addresses):
            raise TypeError(
                f'{type(self).__name__} holds addresses of this process and cannot be pickled: '
                'pickle the Simulation, the Model or the State'
            )
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def _view(self) -> View:
        """Its substitute without compilation."""
        view: View | None = self.__dict__.get('_plain')
        if view is None:
            view = View()
            for name, _, part in self._numba_type_.parts:
                value = getattr(self, name)
                if isinstance(part, VectorType):
                    value = flat(value, part.constant)
                elif isinstance(value, Struct):
                    value = value._view()
                elif not isinstance(part, types.UniTuple):
                    value = np.float64(value) if isinstance(value, float) else np.uint64(value)
                setattr(view, name, value)
            object.__setattr__(self, '_plain', view)
        return view

    @classmethod
    def empty(cls: type[S]) -> S:
        """One without any data; numbers are zero."""
        if cls not in Struct._nothing:
            Struct._nothing[cls] = tuple(map(_nothing_of, cls._hints().values()))
        return cls(*(make() for make in Struct._nothing[cls]))

    @classmethod
    def _hints(cls) -> dict[str, Any]:
        """The types of the fields, in their order; to evaluate them costs more than a table."""
        if cls not in Struct._evaluated:
            hints = get_type_hints(cls, include_extras=True)
            Struct._evaluated[cls] = {field.name: hints[field.name] for field in fields(cls)}
        return Struct._evaluated[cls]

    @classmethod
    def _numba_type(cls, D: int = 0, W: int = 0) -> StructType:
        """Its type in compiled code; D: the length of its `unit`, W: its lanes, if it has some."""
        if (cls, D, W) not in Struct._types:
            hints, parts, word = cls._hints(), [], 0
            module = cls.__module__.removeprefix('alf_ros.')
            for field in fields(cls):
                hint = hints[field.name]
                part: types.Type = _SCALARS.get(hint, types.none)
                if field.name == 'unit':
                    part = types.UniTuple(types.float64, D)
                elif isinstance(hint, type) and issubclass(hint, Struct):
                    has_unit = any(each.name == 'unit' for each in fields(hint))
                    part = hint._numba_type(D if has_unit else 0, W if hint._with_lanes() else 0)
                elif part is types.none:
                    part = VectorType(_number_of(hint, W), cls.constant)
                parts.append((field.name, word, part))
                if field.name != 'unit':
                    word += 2 if isinstance(part, VectorType) else 1
            name = f'{cls.__qualname__}{D or ""}@{module}'
            if W:
                name += f' in {W} lanes'
            Struct._types[cls, D, W] = StructType(name, tuple(parts))
        return Struct._types[cls, D, W]

    @classmethod
    def _with_lanes(cls) -> tuple[str, ...]:
        """The first field `Lanes`, or the first that holds a struct with some; none without."""
        if cls not in Struct._first_lanes:
            found = [
                name
                for name, hint in cls._hints().items()
                if get_origin(hint) is Annotated
                or (isinstance(hint, type) and issubclass(hint, Struct) and hint._with_lanes())
            ]
            Struct._first_lanes[cls] = tuple(found[:1])
        return Struct._first_lanes[cls]

    def _lanes(self) -> int:
        """W of the arrays `Lanes`; 0 without some."""
        for name in self._with_lanes():
            value = getattr(self, name)
            return value._lanes() if isinstance(value, Struct) else int(value.shape[1])
        return 0


def _nothing_of(hint: Any) -> Callable[[], Any]:
    """Makes the empty value of a field; to look into its type costs more than to make it."""
    if hint in _SCALARS:
        return partial(hint, 0)
    if isinstance(hint, type) and issubclass(hint, Struct):
        return hint.empty
    if get_origin(hint) is Annotated:
        return partial(np.zeros, (0, 1))
    return partial(np.zeros, 0, _dtype_in(hint))


def _number_of(hint: Any, W: int) -> types.Number | LanesType:
    """The type of the numbers of an array."""
    if get_origin(hint) is Annotated:
        return LanesType(W, fused=True)
    return from_dtype(np.dtype(_dtype_in(hint)))


def _dtype_in(hint: Any) -> Any:
    """The number type of an `NDArray`: numpy 2.5 hands it on itself, others within a dtype."""
    last = get_args(hint)[-1]
    return (*get_args(last), last)[0]


def _word_of(value: Struct | np.uint64 | float) -> int:
    if isinstance(value, Struct):
        return int(value._address)
    return int(np.float64(value).view(np.uint64) if isinstance(value, float) else value)


def address_of(struct: Struct) -> int:
    """Where `calls.struct_at_address` finds a struct, as long as it lives."""
    if PLAIN:
        structs[struct._address] = struct
    return struct._address


# ------------------------------------------------------------------------ what numba has to know


@register_model(VectorType)
class _VectorModel(models.StructModel):
    def __init__(self, manager: Any, kind: VectorType) -> None:
        members = [('data', types.CPointer(kind.number)), ('size', types.uint64)]
        super().__init__(manager, kind, members)


make_attribute_wrapper(VectorType, 'size', 'size')
register_model(StructType)(models.OpaqueModel)


@unbox(StructType)
def _unbox(kind: StructType, struct: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(struct, '_address')
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


@infer_getattr
class _StructAttribute(AttributeTemplate):
    key = StructType

    def generic_resolve(self, kind: StructType, name: str) -> types.Type | None:
        return next((part for field, _, part in kind.parts if field == name), None)


def load(builder: Any, pointer: Any, constant: bool, align: int | None = None) -> Any:
    """The value at a pointer; `constant`: it need not be read again."""
    value = builder.load(pointer, align=align)
    if constant:
        value.set_metadata('invariant.load', builder.module.add_metadata([]))
    return value


@lower_getattr_generic(StructType)
def _field(context: Any, builder: Any, kind: StructType, table: Any, name: str) -> Any:
    word, part = next((word, part) for field, word, part in kind.parts if field == name)
    words = builder.bitcast(table, _word.as_pointer())

    def read(n: int) -> Any:
        return load(builder, builder.gep(words, [_word(n)]), True)

    if isinstance(part, VectorType):
        vector = cgutils.create_struct_proxy(part)(context, builder)
        number = context.get_value_type(part.number)
        vector.data = builder.inttoptr(read(word), number.as_pointer())
        vector.size = read(word + 1)
        return vector._getvalue()
    if isinstance(part, StructType):
        return builder.inttoptr(read(word), table.type)
    if isinstance(part, types.UniTuple):
        return context.get_constant_null(part)
    if isinstance(part, LanesType):  # the word is where they stand
        numbers = context.get_value_type(part).as_pointer()
        return load(builder, builder.inttoptr(read(word), numbers), True)
    return builder.bitcast(read(word), context.get_value_type(part))


def _index(kind: Any) -> types.Type:
    return types.int64 if types.unliteral(kind).signed else types.uint64


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        vector, index = args
        if isinstance(vector, VectorType) and isinstance(index, types.Integer):
            return signature(vector.number, vector, _index(index))
        return None


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        vector, index, _ = args
        writable = isinstance(vector, VectorType) and not vector.constant
        if writable and isinstance(index, types.Integer):
            return signature(types.void, vector, _index(index), vector.number)
        return None


def element(context: Any, builder: Any, kind: VectorType, vector: Any, at: Any) -> Any:
    """Where number `at` of a vector stands: code that compiled code contains."""
    data = cgutils.create_struct_proxy(kind)(context, builder, value=vector).data
    return builder.gep(data, [at])


@lower_builtin(operator.getitem, VectorType, types.Integer)
def _get(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kind = sig.args[0]
    align = _NUMBER if isinstance(kind.number, LanesType) else None
    return load(builder, element(context, builder, kind, *args), kind.constant, align)


@lower_builtin(operator.setitem, VectorType, types.Integer, types.Number)
@lower_builtin(operator.setitem, VectorType, types.Integer, LanesType)
def _set(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kind = sig.args[0]
    align = _NUMBER if isinstance(kind.number, LanesType) else None
    builder.store(args[2], element(context, builder, kind, *args[:2]), align=align)
    return context.get_dummy_value()


@lowered(flat)
def vector(typing: Any, array: Any) -> Any:
    """The numbers of a contiguous array (any shape), as a struct hands them on; a vector of a
    struct stays as it is."""
    if isinstance(array, VectorType):
        return array(array), lambda context, builder, sig, args: args[0]

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _vector_of(context, builder, sig.args[0], sig.return_type, args[0])

    return VectorType(array.dtype, False)(array), code


@lower_cast(types.Array, VectorType)
def _vector_of(context: Any, builder: Any, kind: Any, to: Any, array: Any) -> Any:
    of = cgutils.create_struct_proxy(kind)(context, builder, value=array)
    made = cgutils.create_struct_proxy(to)(context, builder)
    made.data, made.size = of.data, of.nitems
    return made._getvalue()


def place_of(context: Any, builder: Any, kind: Any, value: Any) -> tuple[Any, Any, int]:
    """Where the numbers of a vector or an array stand, how many they are, and the bytes of one."""
    of = cgutils.create_struct_proxy(kind)(context, builder, value=value)
    count = of.size if isinstance(kind, VectorType) else of.nitems
    return of.data, count, context.get_abi_sizeof(of.data.type.pointee)

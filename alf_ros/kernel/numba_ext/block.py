"""Blocks as values: the D numbers of a point or a vector, which the processor handles together.

`block(unit, v, i)` is block i of a vector v of numbers; `put` writes one, `add` and `subtract`
change one. Blocks add, subtract and scale as vectors do, `b[a]` is a coordinate, and `dot` the
inner product, summed from the first coordinate on. With a `unit` of four a block is four numbers
of a vector, whatever the dimension (`vectors`). A vector that was written by single numbers and
is soon read by blocks makes the processor wait. Vectors that are read by blocks must be written by
blocks.
"""

from __future__ import annotations

import operator
from functools import partial
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inlined
from alf_ros.kernel.numba_ext.lane_numbers import (
    LanesType,
    arithmetic,
    by_parts,
    lanes_among,
    larger,
    stored,
    vector_function,
)
from alf_ros.kernel.numba_ext.plain import lowered
from alf_ros.kernel.numba_ext.structs import VectorType, element, load

Block = Any  # a value of BlockType, in compiled code

_number, _index = ir.DoubleType(), ir.IntType(32)
_ALIGNED = 8  # bytes: blocks stand where they stand


# ---------------------------------------------------- in plain Python a block is a small array


def _plain_block(unit: Any, v: Any, i: Any) -> Any:
    D = len(unit)
    return np.array([v[int(i) * D + a] for a in range(D)])


def _plain_put(v: Any, i: Any, b: Any) -> None:
    for a, number in enumerate(b):
        v[int(i) * len(b) + a] = number


def _plain_add(v: Any, i: Any, b: Any) -> None:
    for a, number in enumerate(b):
        v[int(i) * len(b) + a] += number


def _plain_subtract(v: Any, i: Any, b: Any) -> None:
    for a, number in enumerate(b):
        v[int(i) * len(b) + a] -= number


def _plain_packed(unit: Any, x: float, y: float, z: float) -> Any:
    return np.array((x, y, z)[: len(unit)], dtype=np.float64)


def _plain_zeros(unit: Any) -> Any:
    return np.zeros(len(unit))


def _plain_largest_of(b: Any, c: Any) -> Any:
    return np.where(np.abs(c) > b, np.abs(c), b)


def _plain_dot(b: Any, c: Any) -> Any:
    s = b[0] * c[0]
    for a in range(1, len(b)):
        s += b[a] * c[a]
    return s


def _plain_cross(b: Any, c: Any) -> Any:
    return np.roll(b, -1) * np.roll(c, -2) - np.roll(b, -2) * np.roll(c, -1)


# ----------------------------------------------------------------------- instructions for LLVM


class BlockType(types.Type):
    """D numbers, one beside the other in a register; or D times W lanes, each in its own."""

    def __init__(self, D: int, number: Any = types.float64) -> None:
        self.D, self.number = D, number
        super().__init__(f'block{D} of {number}')

    @property
    def in_lanes(self) -> bool:
        """Whether each of its numbers is one of several members."""
        return isinstance(self.number, LanesType)

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes this one: a block of one member, of all."""
        return Conversion.safe if self._takes(other) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if self._takes(other) else None

    def _takes(self, other: Any) -> bool:
        single = isinstance(other, BlockType) and not other.in_lanes
        return single and self.in_lanes and other.D == self.D


@register_model(BlockType)
class _BlockModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: BlockType) -> None:
        super().__init__(manager, kind, _stored(kind))


def _stored(kind: BlockType) -> Any:
    """Its type for LLVM, in a register and in memory."""
    if kind.in_lanes:
        return ir.ArrayType(stored(_number, kind.number.W), kind.D)
    return ir.VectorType(_number, kind.D)


def _place(context: Any, builder: Any, kind: Any, vector: Any, i: Any, of: BlockType) -> Any:
    at = builder.mul(i, i.type(of.D))
    pointer = element(context, builder, kind, vector, at)
    return builder.bitcast(pointer, _stored(of).as_pointer())


def _each(kind: BlockType, code: Any, builder: Any, *blocks: Any) -> Any:
    """`code`(builder, numbers) of blocks, or an operation of `arithmetic`: at once, or in lanes
    one coordinate after another."""
    if isinstance(code, str):
        code = arithmetic(kind.number, code)
    if not kind.in_lanes:
        return code(builder, *blocks)
    value = ir.Constant(_stored(kind), ir.Undefined)
    for a in range(kind.D):
        of = [builder.extract_value(b, a) if b.type == value.type else b for b in blocks]
        value = builder.insert_value(value, by_parts(builder, code, *of), a)
    return value


def _block_of(unit: Any, v: Any) -> BlockType:
    number = v.number if isinstance(v, VectorType) else types.float64
    return BlockType(len(unit), number if isinstance(number, LanesType) else types.float64)


@lowered(_plain_block)
def block(typing: Any, unit: Any, v: Any, i: Any) -> Any:
    """Block i of v (blocks D,)."""
    kind = _block_of(unit, v)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _place(context, builder, sig.args[1], args[1], args[2], kind)
        constant = getattr(sig.args[1], 'constant', False)
        if not kind.in_lanes:
            return load(builder, pointer, constant, _ALIGNED)
        value = ir.Constant(_stored(kind), ir.Undefined)
        for a in range(kind.D):
            at = builder.gep(pointer, [_index(0), _index(a)])
            value = builder.insert_value(value, load(builder, at, constant, _ALIGNED), a)
        return value

    return kind(unit, v, types.uint64), code


@lowered(_plain_put)
def put(typing: Any, v: Any, i: Any, b: Any) -> Any:
    """Block i of v (blocks D,) = b."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        of = sig.args[2]
        pointer = _place(context, builder, sig.args[0], args[0], args[1], of)
        if not of.in_lanes:
            builder.store(args[2], pointer, align=_ALIGNED)
        else:
            for a in range(of.D):
                at = builder.gep(pointer, [_index(0), _index(a)])
                builder.store(builder.extract_value(args[2], a), at, align=_ALIGNED)
        return context.get_dummy_value()

    return types.void(v, types.uint64, _stored_in(v, b)), code


def _stored_in(v: Any, b: Any) -> Any:
    """The type of a block in a vector: a block of single numbers becomes one of equal lanes."""
    number = v.number if isinstance(v, VectorType) else None
    return BlockType(b.D, number) if isinstance(number, LanesType) else b


def _changed(operation: str, context: Any, builder: Any, sig: Any, args: Any) -> Any:
    of = sig.args[2]
    pointer = _place(context, builder, sig.args[0], args[0], args[1], of)
    change = arithmetic(of.number, operation)
    if not of.in_lanes:
        value = change(builder, builder.load(pointer, align=_ALIGNED), args[2])
        builder.store(value, pointer, align=_ALIGNED)
        return context.get_dummy_value()
    for a in range(of.D):
        at = builder.gep(pointer, [_index(0), _index(a)])
        value = builder.load(at, align=_ALIGNED)
        value = by_parts(builder, change, value, builder.extract_value(args[2], a))
        builder.store(value, at, align=_ALIGNED)
    return context.get_dummy_value()


@lowered(_plain_add)
def add(typing: Any, v: Any, i: Any, b: Any) -> Any:
    """Block i of v (blocks D,) += b."""
    return types.void(v, types.uint64, _stored_in(v, b)), partial(_changed, 'fadd')


@lowered(_plain_subtract)
def subtract(typing: Any, v: Any, i: Any, b: Any) -> Any:
    """Block i of v (blocks D,) -= b."""
    return types.void(v, types.uint64, _stored_in(v, b)), partial(_changed, 'fsub')


@lowered(_plain_packed)
def packed(typing: Any, unit: Any, x: Any, y: Any, z: Any) -> Any:
    """(x, y) in the plane, (x, y, z) in space."""
    number = lanes_among((x, y, z)) or types.float64
    kind = BlockType(len(unit), number)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = ir.Constant(_stored(kind), ir.Undefined)
        for a in range(kind.D):
            if kind.in_lanes:
                value = builder.insert_value(value, args[1 + a], a)
            else:
                value = builder.insert_element(value, args[1 + a], _index(a))
        return value

    return kind(unit, number, number, number), code


@lowered(_plain_zeros)
def zeros(typing: Any, unit: Any) -> Any:
    """The block 0."""
    kind = BlockType(len(unit))

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.get_constant_null(kind)

    return kind(unit), code


@lowered(_plain_largest_of)
def largest_of(typing: Any, b: Any, c: Any) -> Any:
    """Block b, with each coordinate of c, without sign, where it is larger."""

    def change(builder: Any, b: Any, c: Any) -> Any:
        return larger(builder, b, vector_function('llvm.fabs')(builder, c))

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _each(sig.return_type, change, builder, *args)

    kind = c if c.in_lanes else b
    return kind(kind, kind), code


@lowered(_plain_dot)
def dot(typing: Any, b: Any, c: Any) -> Any:
    """The inner product."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = sig.args[0]
        product = _each(kind, 'fmul', builder, *args)

        def of(a: int) -> Any:
            if kind.in_lanes:
                return builder.extract_value(product, a)
            return builder.extract_element(product, _index(a))

        s = of(0)
        for a in range(1, kind.D):
            s = by_parts(builder, arithmetic(kind.number, 'fadd'), s, of(a))
        return s

    kind = c if c.in_lanes else b
    return kind.number(kind, kind), code


@lowered(_plain_cross)
def cross(typing: Any, b: Any, c: Any) -> Any:
    """b × c, in space; in the plane nothing that counts."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = sig.args[0]
        D = kind.D

        def turned(value: Any, by: int) -> Any:
            if kind.in_lanes:
                parts = [builder.extract_value(value, (a + by) % D) for a in range(D)]
                for a, part in enumerate(parts):
                    value = builder.insert_value(value, part, a)
                return value
            order = ir.Constant(ir.VectorType(_index, D), [(a + by) % D for a in range(D)])
            return builder.shuffle_vector(value, value, order)

        one = _each(kind, 'fmul', builder, turned(args[0], 1), turned(args[1], 2))
        other = _each(kind, 'fmul', builder, turned(args[0], 2), turned(args[1], 1))
        return _each(kind, 'fsub', builder, one, other)

    return b(b, c), code


@lower_cast(BlockType, BlockType)
def _in_lanes(context: Any, builder: Any, of: BlockType, to: BlockType, value: Any) -> Any:
    made = ir.Constant(_stored(to), ir.Undefined)
    for a in range(of.D):
        number = builder.extract_element(value, _index(a))
        number = context.cast(builder, number, of.number, to.number)
        made = builder.insert_value(made, number, a)
    return made


class _Of(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if len(args) != 2 or not all(isinstance(kind, BlockType) for kind in args):
            return None
        kind = next((kind for kind in args if kind.in_lanes), args[0])
        return signature(kind, kind, kind)


@infer_global(operator.add)
class _Add(_Of):
    pass


@infer_global(operator.sub)
class _Sub(_Of):
    pass


@infer_global(operator.mul)
class _Mul(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if not isinstance(args[1], BlockType):
            return None
        kind = args[1]
        if isinstance(args[0], LanesType) and not kind.in_lanes:
            kind = BlockType(kind.D, args[0])
        if isinstance(args[0], types.Float) or args[0] == kind.number:
            return signature(kind, kind.number, kind)
        return None


@infer_global(operator.getitem)
class _Coordinate(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], BlockType) and isinstance(args[1], types.Integer):
            return signature(args[0].number, args[0], types.uint64)
        return None


@lower_builtin(operator.add, BlockType, BlockType)
def _add(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _each(sig.return_type, 'fadd', builder, *args)


@lower_builtin(operator.sub, BlockType, BlockType)
def _sub(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _each(sig.return_type, 'fsub', builder, *args)


@lower_builtin(operator.mul, LanesType, BlockType)
@lower_builtin(operator.mul, types.float64, BlockType)
def _mul(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kind = sig.args[1]
    if kind.in_lanes:
        return _each(kind, 'fmul', builder, *args)
    D = kind.D
    empty = ir.Constant(ir.VectorType(_number, D), ir.Undefined)
    one = builder.insert_element(empty, args[0], _index(0))
    firsts = ir.Constant(ir.VectorType(_index, D), [0] * D)
    return builder.fmul(builder.shuffle_vector(one, one, firsts), args[1])


@lower_builtin(operator.getitem, BlockType, types.Integer)
def _coordinate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kind = sig.args[0]
    if not kind.in_lanes:
        return builder.extract_element(*args)
    if isinstance(args[1], ir.Constant):
        a = int(args[1].constant)
        if a >= kind.D:  # in code for space, which the plane does not reach
            return ir.Constant(args[0].type.element, ir.Undefined)
        return builder.extract_value(args[0], a)
    stored = cgutils.alloca_once_value(builder, args[0])
    return builder.load(builder.gep(stored, [_index(0), args[1]]))


@inlined
def times(unit: Unit, T: Floats, n: np.uint64, b: Block) -> Block:
    """Matrix n of T (matrices D D,), by rows, times b."""
    D, last = np.uint64(len(unit)), 0.0
    at = n * D
    if D == THREE:
        last = dot(block(unit, T, at + TWO), b)
    return packed(unit, dot(block(unit, T, at), b), dot(block(unit, T, at + ONE), b), last)


@inlined
def add_outer(unit: Unit, A: Floats, n: np.uint64, b: Block, c: Block) -> None:
    """Matrix n of A (matrices D D,), by rows, += b cᵀ."""
    D = np.uint64(len(unit))
    for a in range(D):
        add(A, n * D + a, b[a] * c)

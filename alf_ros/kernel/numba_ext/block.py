"""Blocks as values: the D numbers of a point or a vector, which the processor handles together.

`block(unit, v, i)` is block i of a vector v of numbers; `put` writes one, `add` and `subtract`
change one. Blocks add, subtract and scale as vectors do, `b[a]` is a coordinate, and `dot` the
inner product, summed from the first coordinate on. A vector that was written by single numbers and
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
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, inlined
from alf_ros.kernel.numba_ext.plain import lowered
from alf_ros.kernel.numba_ext.structs import element, load

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


def _plain_dot(b: Any, c: Any) -> Any:
    s = b[0] * c[0]
    for a in range(1, len(b)):
        s += b[a] * c[a]
    return s


def _plain_cross(b: Any, c: Any) -> Any:
    return np.roll(b, -1) * np.roll(c, -2) - np.roll(b, -2) * np.roll(c, -1)


# ----------------------------------------------------------------------- instructions for LLVM


class BlockType(types.Type):
    """D numbers."""

    def __init__(self, D: int) -> None:
        self.D = D
        super().__init__(f'block{D}')


@register_model(BlockType)
class _BlockModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: BlockType) -> None:
        super().__init__(manager, kind, ir.VectorType(_number, kind.D))


def _place(context: Any, builder: Any, kind: Any, vector: Any, i: Any, D: int) -> Any:
    at = builder.mul(i, i.type(D))
    pointer = element(context, builder, kind, vector, at)
    return builder.bitcast(pointer, ir.VectorType(_number, D).as_pointer())


@lowered(_plain_block)
def block(typing: Any, unit: Any, v: Any, i: Any) -> Any:
    """Block i of v (blocks D,)."""
    kind = BlockType(len(unit))

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _place(context, builder, sig.args[1], args[1], args[2], kind.D)
        return load(builder, pointer, getattr(sig.args[1], 'constant', False), _ALIGNED)

    return kind(unit, v, types.uint64), code


@lowered(_plain_put)
def put(typing: Any, v: Any, i: Any, b: Any) -> Any:
    """Block i of v (blocks D,) = b."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _place(context, builder, sig.args[0], args[0], args[1], sig.args[2].D)
        builder.store(args[2], pointer, align=_ALIGNED)
        return context.get_dummy_value()

    return types.void(v, types.uint64, b), code


def _changed(operation: str, context: Any, builder: Any, sig: Any, args: Any) -> Any:
    pointer = _place(context, builder, sig.args[0], args[0], args[1], sig.args[2].D)
    value = getattr(builder, operation)(builder.load(pointer, align=_ALIGNED), args[2])
    builder.store(value, pointer, align=_ALIGNED)
    return context.get_dummy_value()


@lowered(_plain_add)
def add(typing: Any, v: Any, i: Any, b: Any) -> Any:
    """Block i of v (blocks D,) += b."""
    return types.void(v, types.uint64, b), partial(_changed, 'fadd')


@lowered(_plain_subtract)
def subtract(typing: Any, v: Any, i: Any, b: Any) -> Any:
    """Block i of v (blocks D,) -= b."""
    return types.void(v, types.uint64, b), partial(_changed, 'fsub')


@lowered(_plain_packed)
def packed(typing: Any, unit: Any, x: Any, y: Any, z: Any) -> Any:
    """(x, y) in the plane, (x, y, z) in space."""
    kind = BlockType(len(unit))

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = ir.Constant(ir.VectorType(_number, kind.D), ir.Undefined)
        for a in range(kind.D):
            value = builder.insert_element(value, args[1 + a], _index(a))
        return value

    return kind(unit, types.float64, types.float64, types.float64), code


@lowered(_plain_dot)
def dot(typing: Any, b: Any, c: Any) -> Any:
    """The inner product."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        product = builder.fmul(*args)
        s = builder.extract_element(product, _index(0))
        for a in range(1, sig.args[0].D):
            s = builder.fadd(s, builder.extract_element(product, _index(a)))
        return s

    return types.float64(b, c), code


@lowered(_plain_cross)
def cross(typing: Any, b: Any, c: Any) -> Any:
    """b × c, in space; in the plane nothing that counts."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        D = sig.args[0].D

        def turned(value: Any, by: int) -> Any:
            order = ir.Constant(ir.VectorType(_index, D), [(a + by) % D for a in range(D)])
            return builder.shuffle_vector(value, value, order)

        one = builder.fmul(turned(args[0], 1), turned(args[1], 2))
        return builder.fsub(one, builder.fmul(turned(args[0], 2), turned(args[1], 1)))

    return b(b, c), code


class _Of(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if len(args) == 2 and isinstance(args[0], BlockType) and args[0] == args[1]:
            return signature(args[0], *args)
        return None


@infer_global(operator.add)
class _Add(_Of):
    pass


@infer_global(operator.sub)
class _Sub(_Of):
    pass


@infer_global(operator.mul)
class _Mul(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], types.Float) and isinstance(args[1], BlockType):
            return signature(args[1], types.float64, args[1])
        return None


@infer_global(operator.getitem)
class _Coordinate(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], BlockType) and isinstance(args[1], types.Integer):
            return signature(types.float64, args[0], types.uint64)
        return None


@lower_builtin(operator.add, BlockType, BlockType)
def _add(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fadd(*args)


@lower_builtin(operator.sub, BlockType, BlockType)
def _sub(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fsub(*args)


@lower_builtin(operator.mul, types.float64, BlockType)
def _mul(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    D = sig.args[1].D
    empty = ir.Constant(ir.VectorType(_number, D), ir.Undefined)
    one = builder.insert_element(empty, args[0], _index(0))
    firsts = ir.Constant(ir.VectorType(_index, D), [0] * D)
    return builder.fmul(builder.shuffle_vector(one, one, firsts), args[1])


@lower_builtin(operator.getitem, BlockType, types.Integer)
def _coordinate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.extract_element(*args)


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

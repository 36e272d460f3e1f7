"""Loops that stay as they are written.

LLVM unrolls the loop of a `range`, and adds code before and behind it for the remainder. The rows
and columns of a mechanism may be two or a hundred thousand: for a few, that code is more than the
loop. `for i in each(a, b)` is `for i in range(a, b)` without it: the number of rounds is unknown
to LLVM, because b passes through an empty instruction each time. Loops over plain numbers, which
the vector unit takes several at a time, remain ranges.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import RefType, impl_ret_untracked, iternext_impl
from numba.extending import lower_builtin, models, register_model

from alf_ros.kernel.numba_ext.plain import lowered


class _Iterator(types.SimpleIteratorType):
    def __init__(self) -> None:
        super().__init__('each', types.uint64)


class _Each(types.SimpleIterableType):
    def __init__(self) -> None:
        super().__init__('each of', _Iterator())


@register_model(_Each)
class _EachModel(models.StructModel):
    def __init__(self, manager: Any, kind: _Each) -> None:
        super().__init__(manager, kind, [('first', types.uint64), ('end', types.uint64)])


@register_model(_Iterator)
class _IteratorModel(models.StructModel):
    def __init__(self, manager: Any, kind: _Iterator) -> None:
        members = [('at', types.EphemeralPointer(types.uint64)), ('end', types.uint64)]
        super().__init__(manager, kind, members)


def _range(first: Any, end: Any) -> Any:
    return range(int(first), int(end))


@lowered(_range)
def each(typing: Any, first: Any, end: Any) -> Any:
    """The range of a loop from first up to end, without the empty instruction."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = cgutils.create_struct_proxy(sig.return_type)(context, builder)
        value.first, value.end = args
        return value._getvalue()

    return _Each()(types.uint64, types.uint64), code


@lower_builtin('getiter', _Each)
def _start(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    of = cgutils.create_struct_proxy(sig.args[0])(context, builder, value=args[0])
    iterator = cgutils.create_struct_proxy(sig.return_type)(context, builder)
    iterator.at, iterator.end = cgutils.alloca_once_value(builder, of.first), of.end
    return impl_ret_untracked(context, builder, sig.return_type, iterator._getvalue())


@lower_builtin('iternext', _Iterator)
@iternext_impl(RefType.UNTRACKED)
def _next(context: Any, builder: Any, sig: Any, args: Any, result: Any) -> None:
    iterator = cgutils.create_struct_proxy(sig.args[0])(context, builder, value=args[0])
    at, whole = builder.load(iterator.at), ir.IntType(64)
    nothing = ir.InlineAsm(ir.FunctionType(whole, [whole]), '', '=r,0', side_effect=True)
    end = builder.call(nothing, [iterator.end])
    valid = builder.icmp_unsigned('<', at, end)
    result.set_valid(valid)
    with builder.if_then(valid):
        result.yield_(at)
        builder.store(builder.add(at, at.type(1)), iterator.at)

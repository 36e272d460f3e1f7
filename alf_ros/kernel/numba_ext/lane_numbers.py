"""Numbers of which each is one number of several members: one instruction computes all of them.

Members of an ensemble have the same pattern and different numbers. A function of numbers that is
compiled for lanes computes with a vector register: lane m holds the number of member m. Each lane
has the bits that the function gives for its member alone: sums, products, quotients and roots are
rounded in the same way, and functions without an instruction, such as the sine, are called lane by
lane.

A comparison gives a `Mask`, a truth value for each lane. Code that branches on it says what holds
for a group: `everywhere` and `anywhere`; and `pick` chooses lane by lane. For a single number they
are the comparison itself and a plain choice.
"""

from __future__ import annotations

import builtins
import math
import operator
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model

from alf_ros.kernel.numba_ext.plain import lowered

_REAL = (types.Float, types.Integer, types.Boolean)
_number, _whole, _index = ir.DoubleType(), ir.IntType(64), ir.IntType(32)


@cache
def width() -> int:
    """How many numbers a register of this processor holds."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return 8 if features.get('avx512f') else 4 if features.get('avx2') else 2


class LanesType(types.Type):
    """W numbers. A single number becomes W equal ones."""

    def __init__(self, W: int) -> None:
        self.W = W
        super().__init__(f'lanes{W}')

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes lanes."""
        return Conversion.safe if isinstance(other, _REAL) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if isinstance(other, _REAL) else None


class MaskType(types.Type):
    """W truth values, each a word of all bits or none. A single one becomes W equal ones."""

    def __init__(self, W: int) -> None:
        self.W = W
        super().__init__(f'mask{W}')

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes a mask."""
        return Conversion.safe if isinstance(other, types.Boolean) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if isinstance(other, types.Boolean) else None


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, ir.VectorType(_number, kind.W))


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: MaskType) -> None:
        super().__init__(manager, kind, ir.VectorType(_whole, kind.W))


def _equal(builder: Any, value: Any, W: int) -> Any:
    """A vector of W times a value."""
    empty = ir.Constant(ir.VectorType(value.type, W), ir.Undefined)
    one = builder.insert_element(empty, value, _index(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(_index, W), [0] * W))


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
@lower_cast(types.Boolean, LanesType)
def _to_lanes(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
    return _equal(builder, context.cast(builder, value, of, types.float64), to.W)


@lower_cast(types.Boolean, MaskType)
def _to_mask(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
    return _equal(builder, builder.sext(builder.trunc(value, ir.IntType(1)), _whole), to.W)


def lanes_among(kinds: Any) -> Any:
    """The type of lanes, if some of these are lanes and all others are numbers."""
    found = [kind for kind in kinds if isinstance(kind, LanesType)]
    fits = all(isinstance(kind, (*_REAL, LanesType)) for kind in kinds)
    return found[0] if found and fits else None


def _typed(function: Any, typing: Any) -> None:
    """Take a class of typing for a function, also for one of numpy, which may have no module."""

    class Keyed(typing):
        key = function

    infer_global(function, types.Function(Keyed))


# ------------------------------------------------------------------------------- arithmetic


def _operation(code: Callable[[Any, Any], Any], count: int, *functions: Any) -> None:
    """Take `code`(builder, values) for these functions of `count` lanes."""

    class _Operation(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kind = lanes_among(args) if len(args) == count else None
            return signature(kind, *[kind] * count) if kind else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return code(builder, args)

    for function in functions:
        _typed(function, _Operation)
        lower_builtin(function, *[LanesType] * count)(lower)


def _comparison(sign: str, function: Any) -> None:
    class _Comparison(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kind = lanes_among(args)
            return signature(MaskType(kind.W), kind, kind) if kind else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        compare = builder.fcmp_unordered if sign == '!=' else builder.fcmp_ordered
        return builder.sext(compare(sign, *args), context.get_value_type(sig.return_type))

    _typed(function, _Comparison)
    lower_builtin(function, LanesType, LanesType)(lower)


def _vector_function(name: str) -> Callable[[Any, Any], Any]:
    def code(builder: Any, args: Any) -> Any:
        kind = args[0].type
        full = f'{name}.v{kind.count}f64'
        declared = ir.FunctionType(kind, [kind])
        return builder.call(cgutils.get_or_insert_function(builder.module, declared, full), args)

    return code


def _larger(builder: Any, args: Any) -> Any:
    """As numba has it for two numbers: the second if it is larger."""
    return builder.select(builder.fcmp_ordered('>', args[1], args[0]), args[1], args[0])


def _smaller(builder: Any, args: Any) -> Any:
    return builder.select(builder.fcmp_ordered('<', args[1], args[0]), args[1], args[0])


_operation(lambda builder, args: builder.fadd(*args), 2, operator.add, operator.iadd)
_operation(lambda builder, args: builder.fsub(*args), 2, operator.sub, operator.isub)
_operation(lambda builder, args: builder.fmul(*args), 2, operator.mul, operator.imul)
_operation(lambda builder, args: builder.fdiv(*args), 2, operator.truediv, operator.itruediv)
_operation(lambda builder, args: builder.fneg(*args), 1, operator.neg)
_operation(_vector_function('llvm.fabs'), 1, builtins.abs, math.fabs)
_operation(_vector_function('llvm.sqrt'), 1, np.sqrt, math.sqrt)
_operation(_vector_function('llvm.ceil'), 1, np.ceil)
_operation(_larger, 2, builtins.max)
_operation(_smaller, 2, builtins.min)

for _sign, _function in (
    ('<', operator.lt),
    ('<=', operator.le),
    ('>', operator.gt),
    ('>=', operator.ge),
    ('==', operator.eq),
    ('!=', operator.ne),
):
    _comparison(_sign, _function)


def _lane_by_lane(function: Any, count: int = 1) -> None:
    """Take a function of `count` numbers for each lane."""

    class _LaneByLane(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kind = lanes_among(args) if len(args) == count else None
            return signature(kind, *[kind] * count) if kind else None

    def of_one(x: float) -> float:
        return function(x)

    def of_two(x: float, y: float) -> float:
        return function(x, y)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value, one = args[0], signature(types.float64, *[types.float64] * count)
        for m in range(sig.return_type.W):
            numbers = [builder.extract_element(lanes, _index(m)) for lanes in args]
            single = of_one if count == 1 else of_two
            number = context.compile_internal(builder, single, one, numbers)
            value = builder.insert_element(value, number, _index(m))
        return value

    _typed(function, _LaneByLane)
    lower_builtin(function, *[LanesType] * count)(lower)


for _function in (np.sin, np.cos, np.log, np.rint):
    _lane_by_lane(_function)
_lane_by_lane(np.arctan2, 2)
_lane_by_lane(operator.pow, 2)


# ------------------------------------------------------------------------------------ masks


def _mask_operation(code: Callable[[Any, Any], Any], function: Any) -> None:
    class _MaskOperation(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kinds = [kind for kind in args if isinstance(kind, MaskType)]
            fits = all(isinstance(kind, (MaskType, types.Boolean)) for kind in args)
            return signature(kinds[0], *[kinds[0]] * len(args)) if kinds and fits else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return code(builder, args)

    _typed(function, _MaskOperation)
    lower_builtin(function, MaskType, MaskType)(lower)


_mask_operation(lambda builder, args: builder.and_(*args), operator.and_)
_mask_operation(lambda builder, args: builder.or_(*args), operator.or_)
_mask_operation(lambda builder, args: builder.xor(*args), operator.xor)


def _bits(builder: Any, mask: Any, W: int) -> Any:
    """The lanes of a mask, as W bits of one whole number."""
    truth = builder.icmp_signed('<', mask, ir.Constant(mask.type, [0] * W))
    return builder.bitcast(truth, ir.IntType(W))


def _plainly_all(m: Any) -> Any:
    return bool(m)


def _plainly_any(m: Any) -> Any:
    return bool(m)


def _asked(m: Any, full: bool) -> Any:
    if isinstance(m, types.Boolean):
        return types.boolean(m), lambda context, builder, sig, args: args[0]

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = _bits(builder, args[0], sig.args[0].W)
        if full:
            return builder.icmp_unsigned('==', bits, ir.Constant(bits.type, -1))
        return builder.icmp_unsigned('!=', bits, ir.Constant(bits.type, 0))

    return (types.boolean(m), code) if isinstance(m, MaskType) else None


@lowered(_plainly_all)
def everywhere(typing: Any, m: Any) -> Any:
    """Whether m holds in all lanes; of a single number m itself."""
    return _asked(m, True)


@lowered(_plainly_any)
def anywhere(typing: Any, m: Any) -> Any:
    """Whether m holds in a lane; of a single number m itself."""
    return _asked(m, False)


def _plainly_none(m: Any) -> Any:
    return not m


@lowered(_plainly_none)
def nowhere(typing: Any, m: Any) -> Any:
    """Whether m holds in no lane; of a single number whether it does not hold."""
    if isinstance(m, types.Boolean):
        return _negation(m)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = _bits(builder, args[0], sig.args[0].W)
        return builder.icmp_unsigned('==', bits, ir.Constant(bits.type, 0))

    return types.boolean(m), code


def _plain_pick(m: Any, a: Any, b: Any) -> Any:
    return a if m else b


@lowered(_plain_pick)
def pick(typing: Any, m: Any, a: Any, b: Any) -> Any:
    """a where m holds, else b: numbers, masks, or blocks of them."""
    if not isinstance(m, MaskType):
        kind = typing.unify_types(types.unliteral(a), types.unliteral(b))

        def choose(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.select(builder.trunc(args[0], ir.IntType(1)), args[1], args[2])

        return kind(types.boolean, kind, kind), choose
    kind = next((k for k in (a, b) if not isinstance(k, _REAL)), LanesType(m.W))

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        W = sig.args[0].W
        truth = builder.icmp_signed('<', args[0], ir.Constant(args[0].type, [0] * W))
        if not isinstance(args[1].type, ir.ArrayType):
            return builder.select(truth, args[1], args[2])
        value = args[2]
        for a in range(args[1].type.count):
            one, other = (builder.extract_value(arg, a) for arg in args[1:])
            value = builder.insert_value(value, builder.select(truth, one, other), a)
        return value

    return kind(m, kind, kind), code


def _negation(m: Any) -> Any:
    return m(m), lambda context, builder, sig, args: builder.not_(args[0])


def _plainly_not(m: Any) -> Any:
    return not m


@lowered(_plainly_not)
def unless(typing: Any, m: Any) -> Any:
    """Where m does not hold."""
    return _negation(m)

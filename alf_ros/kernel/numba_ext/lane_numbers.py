"""Numbers of which each is one number of several members: one instruction computes all of them.

Members of an ensemble have the same pattern and different numbers. A function of numbers that is
compiled for lanes computes with a vector register: lane m holds the number of member m. Each lane
has the bits that the function gives for its member alone: sums, products, quotients and roots are
rounded in the same way, and functions without an instruction, such as the sine, are called lane by
lane.

A comparison gives a `Mask`, a truth value for each lane. Code that branches on it says what holds
for a group: `everywhere` and `anywhere`; and `pick` chooses lane by lane. For a single number they
are the comparison itself and a plain choice.

Lanes of derivatives are no members: no single run has their bits. They are `fused`: a product that
is added is one instruction with it, which rounds once.

If W is a power of two, the numbers are one vector for LLVM. It would widen a vector of 12 to one
of 16 and compute with all of them. So other W, multiples of 4, are vectors of 4 (`by_parts`).
"""

from __future__ import annotations

import builtins
import math
import operator
from collections.abc import Callable
from functools import cache, partial, reduce
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, lower_cast, models, register_model

from alf_ros.kernel.numba_ext.number_types import PLAIN, PlainBecomes
from alf_ros.kernel.numba_ext.plain import lowered

_number, _whole, _index = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_PART = 4  # numbers of a vector, if W is no power of two


@cache
def width() -> int:
    """How many numbers a register of this processor holds."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return 8 if features.get('avx512f') else 4 if features.get('avx2') else 2


class LanesType(PlainBecomes):
    """W numbers. A single number becomes W equal ones. `fused`: see above."""

    def __init__(self, W: int, fused: bool = False) -> None:
        self.W, self.fused = W, fused
        super().__init__(f'fused lanes{W}' if fused else f'lanes{W}')


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


def stored(number: Any, W: int) -> Any:
    """The type of W numbers for LLVM."""
    if W & (W - 1) == 0:
        return ir.VectorType(number, W)
    return ir.ArrayType(ir.VectorType(number, _PART), W // _PART)


def _parts(builder: Any, value: Any) -> list[Any]:
    """The vectors of lanes or a mask; of anything else the value itself."""
    if not isinstance(value.type, ir.ArrayType):
        return [value]
    return [builder.extract_value(value, n) for n in range(value.type.count)]


def by_parts(builder: Any, code: Callable[..., Any], *values: Any) -> Any:
    """`code`(builder, vectors) of lanes and masks, vector by vector."""
    vectors = [_parts(builder, value) for value in values]
    found = [code(builder, *each) for each in zip(*vectors, strict=True)]
    if not isinstance(values[0].type, ir.ArrayType):
        return found[0]
    made = ir.Constant(ir.ArrayType(found[0].type, len(found)), ir.Undefined)
    for n, part in enumerate(found):
        made = builder.insert_value(made, part, n)
    return made


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, stored(_number, kind.W))


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: MaskType) -> None:
        super().__init__(manager, kind, stored(_whole, kind.W))


def _equal(builder: Any, value: Any, W: int) -> Any:
    """W times a value."""

    def code(builder: Any, empty: Any) -> Any:
        count = empty.type.count
        one = builder.insert_element(empty, value, _index(0))
        firsts = ir.Constant(ir.VectorType(_index, count), [0] * count)
        return builder.shuffle_vector(one, one, firsts)

    return by_parts(builder, code, ir.Constant(stored(value.type, W), ir.Undefined))


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
    fits = all(isinstance(kind, (*PLAIN, LanesType)) for kind in kinds)
    return found[0] if found and fits else None


def _typed(function: Any, typing: Any) -> None:
    """Take a class of typing for a function, also for one of numpy, which may have no module."""

    class Keyed(typing):
        key = function

    infer_global(function, types.Function(Keyed))


# ------------------------------------------------------------------------------- arithmetic


def arithmetic(kind: Any, operation: str) -> Callable[..., Any]:
    """Instructions for LLVM: 'fadd', 'fsub' or 'fmul' of numbers of this kind."""
    code = getattr(ir.IRBuilder, operation)
    return partial(code, flags=('contract',)) if getattr(kind, 'fused', False) else code


def _operation(code: Callable[..., Any] | str, count: int, *functions: Any) -> None:
    """Take `code`(builder, vectors), or an operation of `arithmetic`, for these functions of
    `count` lanes."""

    class _Operation(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kind = lanes_among(args) if len(args) == count else None
            return signature(kind, *[kind] * count) if kind else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        own = arithmetic(sig.return_type, code) if isinstance(code, str) else code
        return by_parts(builder, own, *args)

    for function in functions:
        _typed(function, _Operation)
        lower_builtin(function, *[LanesType] * count)(lower)


def _comparison(sign: str, function: Any) -> None:
    class _Comparison(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kind = lanes_among(args)
            return signature(MaskType(kind.W), kind, kind) if kind else None

    def code(builder: Any, x: Any, y: Any) -> Any:
        compare = builder.fcmp_unordered if sign == '!=' else builder.fcmp_ordered
        return builder.sext(compare(sign, x, y), ir.VectorType(_whole, x.type.count))

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return by_parts(builder, code, *args)

    _typed(function, _Comparison)
    lower_builtin(function, LanesType, LanesType)(lower)


def vector_function(name: str) -> Callable[[Any, Any], Any]:
    """Instructions for LLVM: a function of each number of a vector."""

    def code(builder: Any, x: Any) -> Any:
        full = f'{name}.v{x.type.count}f64'
        declared = ir.FunctionType(x.type, [x.type])
        return builder.call(cgutils.get_or_insert_function(builder.module, declared, full), [x])

    return code


def larger(builder: Any, x: Any, y: Any) -> Any:
    """As numba has it for two numbers: the second if it is larger."""
    return builder.select(builder.fcmp_ordered('>', y, x), y, x)


def _smaller(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_ordered('<', y, x), y, x)


_operation('fadd', 2, operator.add, operator.iadd)
_operation('fsub', 2, operator.sub, operator.isub)
_operation('fmul', 2, operator.mul, operator.imul)
_operation(ir.IRBuilder.fdiv, 2, operator.truediv, operator.itruediv)
_operation(ir.IRBuilder.fneg, 1, operator.neg)
_operation(vector_function('llvm.fabs'), 1, builtins.abs, math.fabs)
_operation(vector_function('llvm.sqrt'), 1, np.sqrt, math.sqrt)
_operation(vector_function('llvm.ceil'), 1, np.ceil)
_operation(larger, 2, builtins.max)
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


def lane_by_lane(function: Any, count: int = 1) -> None:
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
        single = of_one if count == 1 else of_two
        one = signature(types.float64, *[types.float64] * count)

        def code(builder: Any, *vectors: Any) -> Any:
            value = vectors[0]
            for m in range(value.type.count):
                numbers = [builder.extract_element(vector, _index(m)) for vector in vectors]
                number = context.compile_internal(builder, single, one, numbers)
                value = builder.insert_element(value, number, _index(m))
            return value

        return by_parts(builder, code, *args)

    _typed(function, _LaneByLane)
    lower_builtin(function, *[LanesType] * count)(lower)


KNOWN = np.sin, np.cos, np.log, np.rint, np.arctan2, operator.pow  # lane by lane
for _function in KNOWN[:4]:
    lane_by_lane(_function)
for _function in KNOWN[4:]:
    lane_by_lane(_function, 2)


# ------------------------------------------------------------------------------------ masks


def _mask_operation(code: Callable[..., Any], function: Any) -> None:
    class _MaskOperation(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kinds = [kind for kind in args if isinstance(kind, MaskType)]
            fits = all(isinstance(kind, (MaskType, types.Boolean)) for kind in args)
            return signature(kinds[0], *[kinds[0]] * len(args)) if kinds and fits else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return by_parts(builder, code, *args)

    _typed(function, _MaskOperation)
    lower_builtin(function, MaskType, MaskType)(lower)


_mask_operation(ir.IRBuilder.and_, operator.and_)
_mask_operation(ir.IRBuilder.or_, operator.or_)
_mask_operation(ir.IRBuilder.xor, operator.xor)


def _truth(builder: Any, mask: Any) -> Any:
    """A vector of a mask, a bit for each lane."""
    return builder.icmp_signed('<', mask, ir.Constant(mask.type, [0] * mask.type.count))


def _are_all(builder: Any, mask: Any, value: bool) -> Any:
    """Whether a mask has this value in all lanes."""
    found = []
    for part in _parts(builder, mask):
        bits = builder.bitcast(_truth(builder, part), ir.IntType(part.type.count))
        found.append(builder.icmp_unsigned('==', bits, ir.Constant(bits.type, -int(value))))
    return reduce(builder.and_, found)


def _plainly_all(m: Any) -> Any:
    return bool(m)


def _plainly_any(m: Any) -> Any:
    return bool(m)


def _asked(m: Any, full: bool) -> Any:
    if isinstance(m, types.Boolean):
        return types.boolean(m), lambda context, builder, sig, args: args[0]

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if full:
            return _are_all(builder, args[0], True)
        return builder.not_(_are_all(builder, args[0], False))

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
        return _are_all(builder, args[0], False)

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
    kind = next((k for k in (a, b) if not isinstance(k, PLAIN)), LanesType(m.W))

    def chosen(builder: Any, mask: Any, x: Any, y: Any) -> Any:
        return builder.select(_truth(builder, mask), x, y)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if isinstance(kind, (LanesType, MaskType)):
            return by_parts(builder, chosen, *args)
        value = args[2]
        for n in range(value.type.count):
            x, y = (builder.extract_value(arg, n) for arg in args[1:])
            value = builder.insert_value(value, by_parts(builder, chosen, args[0], x, y), n)
        return value

    return kind(m, kind, kind), code


def _negation(m: Any) -> Any:
    return m(m), lambda context, builder, sig, args: by_parts(builder, ir.IRBuilder.not_, *args)


def _plainly_not(m: Any) -> Any:
    return not m


@lowered(_plainly_not)
def unless(typing: Any, m: Any) -> Any:
    """Where m does not hold."""
    return _negation(m)

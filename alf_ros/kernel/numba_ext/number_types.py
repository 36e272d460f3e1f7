"""Types of compiled code that are made of named parts, and numbers among them.

Dual, traced and branch numbers are such numbers: a value with a slope, a place or a note; so are
lanes that may part. A plain number becomes one of them where both are met.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.extending import lower_cast, make_attribute_wrapper, models, overload, register_model

from alf_ros.kernel.numba_ext.inner_code import InnerCompiler

PLAIN = (types.Float, types.Integer, types.Boolean)  # types of plain numbers
_OPTIONS: dict[str, Any] = {'error_model': 'numpy'}
# only compiled code calls these: they need no machine code of their own
_CALLED: dict[str, Any] = {
    **_OPTIONS,
    'no_cpython_wrapper': True,
    'no_cfunc_wrapper': True,
    'pipeline_class': InnerCompiler,
}
# These have some: LLVM makes them short before it puts them into others. As they are written, all
# of them together in one function take twice the time.
_INLINED: dict[str, Any] = {**_OPTIONS, 'forceinline': True}
_Matching = Callable[..., Any]


class PlainBecomes(types.Type):
    """A number that a plain number can become."""

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether another type becomes this one."""
        return Conversion.safe if isinstance(other, PLAIN) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type of a variable that is either."""
        return self if isinstance(other, PLAIN) else None


class PartsType(types.Type):
    """Named parts. A subclass names them; an instance says of which types they are."""

    parts: ClassVar[tuple[str, ...]] = ()

    def __init__(self, name: str, *kinds: Any) -> None:
        self.kinds = kinds
        super().__init__(name)

    def __init_subclass__(cls) -> None:
        @register_model(cls)
        class _Model(models.StructModel):
            def __init__(self, manager: Any, kind: PartsType) -> None:
                super().__init__(manager, kind, list(zip(kind.parts, kind.kinds, strict=True)))

        for part in cls.parts:
            make_attribute_wrapper(cls, part, part)


class NumberType(PartsType, PlainBecomes):
    """A number with named parts. A plain one becomes its `value`; `plain`: its other parts that
    are not zero."""

    plain: ClassVar[dict[str, int]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()

        def cast(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
            made = cgutils.create_struct_proxy(to)(context, builder)
            for part in to.parts:
                number = to.plain.get(part)
                setattr(made, part, ir.Constant(getattr(made, part).type, number))
            made.value = context.cast(builder, value, of, to.kinds[0])
            return made._getvalue()

        for plain in PLAIN:
            lower_cast(plain, cls)(cast)


def made_of(kind: PartsType) -> Any:
    """Signature and code of an intrinsic that makes a value out of its parts."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        made = cgutils.create_struct_proxy(kind)(context, builder)
        for part, value in zip(kind.parts, args, strict=True):
            setattr(made, part, value)
        return made._getvalue()

    return kind(*kind.kinds), code


def converted(kind: NumberType, x: Any, *others: Any) -> Any:
    """Signature and code of an intrinsic that gives its first argument as such a number."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.cast(builder, args[0], sig.args[0], kind)

    return kind(*(types.unliteral(each) for each in (x, *others))), code


def some(kind: NumberType, *found: Any) -> bool:
    """Whether all these types are numbers and one of them is `kind`."""
    return kind in found and all(each == kind or isinstance(each, PLAIN) for each in found)


def called(function: Callable[..., Any]) -> Any:
    """The function, compiled; what calls it may call it or take it in."""
    from numba import njit

    return njit(function, **_CALLED)


def inlined(function: Callable[..., Any]) -> Any:
    """The function, compiled into whatever calls it."""
    from numba import njit

    return njit(function, **_INLINED)


def called_for(*functions: Any) -> Callable[[_Matching], _Matching]:
    """Define these functions for the types that the decorated function knows."""
    return partial(_defined, functions, _CALLED)


def inlined_for(*functions: Any) -> Callable[[_Matching], _Matching]:
    """The same, compiled into whatever calls them."""
    return partial(_defined, functions, _INLINED)


def _defined(functions: tuple[Any, ...], options: dict[str, Any], matching: _Matching) -> Any:
    for function in functions:
        overload(function, strict=False, jit_options=options)(matching)
    return matching


def _of_more(function: Callable[..., Any]) -> None:
    """max and min of three numbers or more are such of two, again and again."""

    def matching(x: Any, y: Any, z: Any, *more: Any) -> Any:
        kinds = x, y, z, *more
        numbers = all(isinstance(kind, (NumberType, *PLAIN)) for kind in kinds)
        if numbers and any(isinstance(kind, NumberType) for kind in kinds):
            return lambda x, y, z, *more: function(function(x, y), z, *more)
        return None

    called_for(function)(matching)


_of_more(max)
_of_more(min)

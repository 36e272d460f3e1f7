"""Derivatives by the complex step, of the project's own Python functions: f(x + i h v) has the
slope of f along v as its imaginary part, divided by h. There is no difference, so h = 1e-100
leaves all digits (W. Squire & G. Trapp, SIAM Review 40, 1998).

`Rebound` runs a function as it is written, with other globals: complex numbers need other square
roots and angles than real ones. The rules of complex numbers are the only ones that are used.
"""

from __future__ import annotations

import cmath
import math
import operator
import sys
from collections.abc import Callable, Mapping, Sequence
from types import CellType, CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher

from alf_ros.arrays import Floats
from alf_ros.kernel.numba_ext.branch_notes import plain_value
from alf_ros.kernel.numba_ext.plain_loops import each

H = 1e-100


class Complex:
    """A complex number that is compared, and rounded to a whole number, by its real part. numpy
    does not compute with it: a function of numpy fails."""

    __slots__ = ('z',)
    __array_ufunc__ = None

    def __init__(self, z: complex) -> None:
        self.z = z

    def __neg__(self) -> Complex:
        return Complex(-self.z)

    def __abs__(self) -> Complex:
        return -self if self.z.real < 0.0 else self

    def __int__(self) -> int:
        return int(self.z.real)

    def __hash__(self) -> int:
        return hash(self.z)


def _plain(x: Any) -> complex:
    return x.z if isinstance(x, Complex) else complex(x)


def _take_arithmetic() -> None:
    def of(compute: Callable[[Any, Any], Any], turned: bool) -> Any:
        if turned:  # the other number is none of these: its own method has been asked before
            return lambda self, other: Complex(compute(complex(other), self.z))

        # millions of calls: without one of `_plain` in each
        def computed(self: Complex, other: Any) -> Complex:
            return Complex(compute(self.z, other.z if type(other) is Complex else complex(other)))

        return computed

    for name in ('add', 'sub', 'mul', 'truediv', 'pow'):
        for turned in (False, True):
            setattr(Complex, f'__{"r" * turned}{name}__', of(getattr(operator, name), turned))

    def by_real_part(compare: Callable[[Any, Any], bool]) -> Any:
        return lambda self, other: compare(self.z.real, _plain(other).real)

    for name in ('lt', 'le', 'gt', 'ge', 'eq', 'ne'):
        setattr(Complex, f'__{name}__', by_real_part(getattr(operator, name)))


_take_arithmetic()


def along(x: Floats, v: Floats) -> list[Any]:
    """x + i h v."""
    return [Complex(complex(a, H * b)) for a, b in zip(x, v, strict=True)]


def value(x: Any) -> float:
    """The real part."""
    return _plain(x).real


def slope(x: Any) -> float:
    """The derivative along v of a number that follows from `along`."""
    return _plain(x).imag / H


def values(x: Sequence[Any]) -> Floats:
    """`value` of each."""
    return np.array([value(one) for one in x])


def slopes(x: Sequence[Any]) -> Floats:
    """`slope` of each."""
    return np.array([slope(one) for one in x])


def _angle(y: Any, x: Any) -> Any:
    """atan2, analytic beside the direction of (x, y). The quotient is at most 1."""
    sine, cosine = _plain(y), _plain(x)
    if abs(sine.real) <= abs(cosine.real):
        turn = 0.0 if cosine.real > 0.0 else math.copysign(math.pi, sine.real)
        return Complex(cmath.atan(sine / cosine) + turn)
    return Complex(math.copysign(0.5 * math.pi, sine.real) - cmath.atan(cosine / sine))


def _of_one(function: Callable[[complex], complex]) -> Any:
    return lambda x: Complex(function(_plain(x)))


_OF_ONE = ('sqrt', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'exp', 'log')
FUNCTIONS: dict[str, Any] = {
    **{name: _of_one(getattr(cmath, name)) for name in _OF_ONE},
    'atan2': _angle,
    'hypot': lambda x, y: Complex(cmath.sqrt(_plain(x * x + y * y))),
    'floor': lambda x: math.floor(value(x)),
    'ceil': lambda x: math.ceil(value(x)),
}
_NUMBERS = {name: getattr(math, name) for name in ('pi', 'inf')}
IN_COMPLEX: dict[Any, Any] = {
    math: SimpleNamespace(**FUNCTIONS, **_NUMBERS),  # whatever else a function asks for fails
    **{getattr(math, name): function for name, function in FUNCTIONS.items()},
    plain_value: value,
    each: range,
}


class Rebound:
    """Functions with other globals: where one of the keys of `instead` is meant, its value is. All
    that they call in the packages `within` has them too, compiled functions as they are written.
    `called`: the functions that have run."""

    def __init__(self, instead: Mapping[Any, Any], within: tuple[str, ...]) -> None:
        self._instead, self._within, self._made = dict(instead), within, dict[Any, Any]()
        self.called = set[Any]()

    def __call__(self, thing: Any) -> Any:
        """A function, class or module that is rebound; all else as it is."""
        try:
            if thing in self._instead:
                return self._instead[thing]
        except (TypeError, ValueError):
            return thing  # an array, or another thing that is no key
        thing = thing.py_func if isinstance(thing, CPUDispatcher) else thing
        if isinstance(thing, ModuleType):
            return _Module(self, thing) if thing.__name__.startswith(self._within) else thing
        if not str(getattr(thing, '__module__', '')).startswith(self._within):
            return thing
        if isinstance(thing, (FunctionType, type)):
            if thing not in self._made:
                make: Any = self._class if isinstance(thing, type) else self._function
                self._made[thing] = make(thing)
            return self._made[thing]
        return thing

    def _function(self, function: Any) -> Any:
        inside = getattr(function, '__wrapped__', function)  # what is remembered is of real ones
        everywhere: dict[str, Any] = inside.__globals__
        own = {'__builtins__': __builtins__, '__name__': inside.__module__}
        closure = inside.__closure__ or ()
        cells = tuple(CellType(self(cell.cell_contents)) for cell in closure)
        made = FunctionType(inside.__code__, own, inside.__name__, inside.__defaults__, cells)
        made.__kwdefaults__ = inside.__kwdefaults__

        def run(*arguments: Any, **named: Any) -> Any:
            if function not in self.called:
                self.called.add(function)
                used = _names(inside.__code__) & everywhere.keys()
                own.update({name: self(everywhere[name]) for name in used})
            return made(*arguments, **named)

        return run

    def _class(self, kind: type) -> type:
        file = sys.modules[kind.__module__].__file__
        functions = {n: f for n, f in vars(kind).items() if isinstance(f, FunctionType)}
        written = {n: self(f) for n, f in functions.items() if f.__code__.co_filename == file}
        return type(kind.__name__, (kind,), written) if written else kind


class _Module:
    """A module whose functions are rebound."""

    def __init__(self, rebound: Rebound, module: ModuleType) -> None:
        self._rebound, self._module = rebound, module

    def __getattr__(self, name: str) -> Any:
        return self._rebound(getattr(self._module, name))


def _names(code: CodeType) -> set[str]:
    inner = [each for each in code.co_consts if isinstance(each, CodeType)]
    return set(code.co_names).union(*map(_names, inner))


in_complex = Rebound(IN_COMPLEX, ('alf_ros.effects.', 'alf_ros.kernel.', 'alf_ros.model.'))

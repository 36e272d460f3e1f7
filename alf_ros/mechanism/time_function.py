"""Functions of time: what an expression of t, or a table, is made of.

A Signal is a tree of operations that two and more derivatives are known of. Arithmetic on one
makes another, so that an expression evaluated with t for a number is the tree of that expression.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# of one argument, of two, and what else the machine knows (`signal_machine`)
UNARY = ('sqrt', 'sin', 'cos', 'tan', 'asin', 'exp', 'log', 'abs')
BINARY = ('add', 'sub', 'mul', 'div', 'pow', 'atan2', 'hypot', 'min', 'max')
OPERATIONS = ('number', 'time', 'table', 'rate', *UNARY, *BINARY)
JUMPS = ('floor', 'ceil')

_RIGHT = 1.5707963267948966
_DEGREE = 0.017453292519943295


class NotSmooth(ValueError):
    """An operation that would make a function of time jump."""


@dataclass(frozen=True)
class Signal:
    """`operation` on `arguments`; a 'number' holds its `value`, a 'table' its `points` (x, f)."""

    operation: str
    arguments: tuple[Signal, ...] = ()
    value: float = 0.0
    points: tuple[tuple[float, float], ...] = ()

    def __add__(self, other: Signal | float) -> Signal:
        return _of('add', self, other)

    def __radd__(self, other: float) -> Signal:
        return _of('add', other, self)

    def __sub__(self, other: Signal | float) -> Signal:
        return _of('sub', self, other)

    def __rsub__(self, other: float) -> Signal:
        return _of('sub', other, self)

    def __mul__(self, other: Signal | float) -> Signal:
        return _of('mul', self, other)

    def __rmul__(self, other: float) -> Signal:
        return _of('mul', other, self)

    def __truediv__(self, other: Signal | float) -> Signal:
        return _of('div', self, other)

    def __rtruediv__(self, other: float) -> Signal:
        return _of('div', other, self)

    def __pow__(self, other: Signal | float) -> Signal:
        return _of('pow', self, other)

    def __rpow__(self, other: float) -> Signal:
        return _of('pow', other, self)

    def __pos__(self) -> Signal:
        return self

    def __neg__(self) -> Signal:
        return -1.0 * self

    def __floordiv__(self, other: Signal | float) -> Signal:
        raise NotSmooth('// makes a function of time jump')

    __rfloordiv__ = __floordiv__

    def __mod__(self, other: Signal | float) -> Signal:
        raise NotSmooth('% makes a function of time jump')

    __rmod__ = __mod__


TIME = Signal('time')


def signal(value: Signal | float) -> Signal:
    """A number as a function of time."""
    return value if isinstance(value, Signal) else Signal('number', value=float(value))


def table(points: Sequence[tuple[float, float]]) -> Signal:
    """The cubic spline through points (t, f) that is at rest at both ends, and stays there.

    Raises ValueError unless t ascends and there are two points.
    """
    times = [t for t, _ in points]
    if len(times) < 2:
        raise ValueError('a table of a motion needs two rows at least')
    if any(after <= before for before, after in zip(times, times[1:], strict=False)):
        raise ValueError('the times of a table must ascend')
    return Signal('table', (TIME,), points=tuple((float(t), float(f)) for t, f in points))


def tables(function: Signal) -> list[tuple[tuple[float, float], ...]]:
    """The points of each table in a function."""
    found = [points for each in function.arguments for points in tables(each)]
    return [*found, function.points] if function.points else found


def rate(speed: Signal | float) -> Signal:
    """A function with this rate, for uses of its rates only: its value is set to zero."""
    return Signal('rate', (signal(speed),))


def cosine(angle: Signal) -> Signal:
    """The cosine of an angle (rad)."""
    return Signal('cos', (angle,))


def sine(angle: Signal) -> Signal:
    """The sine of an angle (rad)."""
    return Signal('sin', (angle,))


def call(name: str, *arguments: Signal | float) -> Signal:
    """A function of `expression` applied to functions of time. Raises NotSmooth, TypeError."""
    if name in JUMPS:
        raise NotSmooth(f'{name} makes a function of time jump')
    given = [signal(argument) for argument in arguments]
    if name in ('min', 'max'):
        total = given[0]
        for each in given[1:]:
            total = _of(name, total, each)
        return total
    two = name in ('atan2', 'hypot', 'log') and len(given) == 2
    if len(given) != (2 if two or name in ('atan2', 'hypot') else 1):
        raise TypeError(name)
    first, last = given[0], given[-1]
    if name in UNARY and not two:
        return Signal(name, (first,))
    match name:
        case 'acos':
            return _RIGHT - Signal('asin', (first,))
        case 'atan':
            return _of('atan2', first, 1.0)
        case 'atan2' | 'hypot':
            return _of(name, first, last)
        case 'log':
            return Signal('log', (first,)) / Signal('log', (last,))
        case 'degrees':
            return first / _DEGREE
        case 'radians':
            return first * _DEGREE
    raise TypeError(name)


def _of(operation: str, *arguments: Signal | float) -> Signal:
    return Signal(operation, tuple(signal(argument) for argument in arguments))

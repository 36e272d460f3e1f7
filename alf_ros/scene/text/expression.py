"""Arithmetic in input files: `2*L*cos(pi/4)` to a finite float, and nothing else.

Python's own parser reads the text, but only the nodes listed here are turned into a function;
nothing is ever handed to `eval`. All arithmetic is in 64-bit floats, so `9**9**9**9` overflows
at once instead of filling the memory. Angles are in radians.
"""

from __future__ import annotations

import ast
import keyword
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

from alf_ros import columns
from alf_ros.columns import Column
from alf_ros.errors import shortened
from alf_ros.mechanism import time_function
from alf_ros.mechanism.time_function import NotSmooth, Signal

LONGEST = 1000
DEEPEST = 100

CONSTANTS: dict[str, float] = {'pi': math.pi, 'tau': math.tau, 'e': math.e}
FUNCTIONS: dict[str, Callable[..., float]] = {
    'sqrt': math.sqrt,
    'sin': math.sin,
    'cos': math.cos,
    'tan': math.tan,
    'asin': math.asin,
    'acos': math.acos,
    'atan': math.atan,
    'atan2': math.atan2,
    'hypot': math.hypot,
    'exp': math.exp,
    'log': math.log,
    'floor': lambda x: float(math.floor(x)),  # as floats: all arithmetic has 64 bits
    'ceil': lambda x: float(math.ceil(x)),
    'degrees': math.degrees,
    'radians': math.radians,
    'abs': abs,
    'min': min,
    'max': max,
}


def _power(base: Any, exponent: Any) -> Any:
    if isinstance(base, Signal) or isinstance(exponent, Signal):
        return base**exponent
    # `pow` refuses (-8)**(1/3), where ** would answer with a complex number
    return columns.each(math.pow, base, exponent)


_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: _power,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_DECIMAL = re.compile(r'[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?')
_DIGIT = re.compile('[1-9]')
_ALLOWED = re.compile(r'[0-9A-Za-z_.+\-*/%(), ]*')
_NOT_FINITE = re.compile(r'[-+]?\.?(inf|infinity|nan)', re.IGNORECASE)

Evaluator = Callable[[Mapping[str, Any]], Any]


class ExpressionError(ValueError):
    """The text is not arithmetic, or has no finite value.

    For an unknown name, `name` is that name and `choices` the names that would be valid.
    """

    def __init__(self, message: str, name: str | None = None, choices: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.name, self.choices = name, tuple(choices)


def evaluate(text: str, names: Mapping[str, float]) -> float:
    """Value of `text`, in which `names` may be used; raises ExpressionError.

    >>> evaluate('2*L*sin(pi/2)', {'L': 1.5})
    3.0
    """
    value = columns.real(_evaluated(text.strip(), names))
    if not isinstance(value, Column) and not math.isfinite(value):
        raise ExpressionError('not a finite number')
    return value


def motion(text: str, names: Mapping[str, float]) -> Signal:
    """`text` as a function of t, the time; raises ExpressionError."""
    if 't' in names:
        raise ExpressionError('t is the time here, but also the name of a parameter', 't')
    value = _evaluated(text.strip(), {**names, 't': time_function.TIME})
    if not isinstance(value, Signal) and not math.isfinite(value):
        raise ExpressionError('not a finite number')
    return time_function.signal(value)


def _evaluated(text: str, names: Mapping[str, Any]) -> Any:
    try:
        if _DECIMAL.fullmatch(text):
            return _not_lost(float(text), _DIGIT.search(text.lower().partition('e')[0]))
        return _compiled(text)(names)
    except ZeroDivisionError:
        raise ExpressionError('division by zero') from None
    except OverflowError:
        raise ExpressionError('too large for a 64-bit number') from None
    except ExpressionError:
        raise
    except NotSmooth as error:
        raise ExpressionError(str(error)) from None
    except ValueError:
        raise ExpressionError('a function is not defined there') from None
    except TypeError:
        raise ExpressionError('wrong number of arguments') from None


def _not_lost(value: Any, *factors: Any) -> Any:
    """The value, which is zero only if a factor is. Raises ExpressionError where it is too
    small."""
    if type(value) is float and value == 0.0 and all(factors):
        raise ExpressionError('too small for a 64-bit number')
    return value


def reserved(name: str) -> bool:
    """Whether `name` means something in every expression, so that no parameter may have it."""
    return (
        name in CONSTANTS
        or name in FUNCTIONS
        or keyword.iskeyword(name)
        or _NOT_FINITE.fullmatch(name) is not None
    )


@lru_cache(maxsize=4096)
def _compiled(text: str) -> Evaluator:
    """Check once, evaluate often: a repeated item evaluates the same text for every index."""
    if not text:
        raise ExpressionError('empty')
    if _NOT_FINITE.fullmatch(text):
        raise ExpressionError('not a finite number')
    if len(text) > LONGEST:
        raise ExpressionError(f'longer than {LONGEST} characters')
    if not _ALLOWED.fullmatch(text):
        raise ExpressionError('not arithmetic')
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # '2if' and the like warn before they fail
            tree = ast.parse(text, mode='eval')
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError('not arithmetic') from None
    return _function(tree.body, DEEPEST)


def _function(node: ast.expr, depth: int) -> Evaluator:
    if depth == 0:
        raise ExpressionError('nested too deeply')
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            value = float(number)
            return lambda names: value
        case ast.BinOp(left=first, op=ast.Mult() | ast.Div() | ast.Pow() as op, right=second):
            binary = _BINARY[type(op)]
            left, right = _function(first, depth - 1), _function(second, depth - 1)
            keeps = isinstance(op, ast.Mult)  # whether zero comes from either side

            def product(names: Mapping[str, Any]) -> Any:
                a, b = left(names), right(names)
                value = binary(a, b)
                return _not_lost(value, a, b) if keeps else _not_lost(value, a)

            return product
        case ast.Name(id=name):
            return _constant_or_parameter(name)
        case ast.UnaryOp(op=sign, operand=inner) if type(sign) in _UNARY:
            unary, operand = _UNARY[type(sign)], _function(inner, depth - 1)
            return lambda names: unary(operand(names))
        case ast.BinOp(left=first, op=op, right=second) if type(op) in _BINARY:
            binary = _BINARY[type(op)]
            left, right = _function(first, depth - 1), _function(second, depth - 1)
            return lambda names: binary(left(names), right(names))
        case ast.Call(func=ast.Name(id=name), args=inputs, keywords=[]):
            if name not in FUNCTIONS:
                raise ExpressionError(f'unknown function {shortened(repr(name))}', name, FUNCTIONS)
            call, arguments = FUNCTIONS[name], [_function(i, depth - 1) for i in inputs]
            return lambda names: _called(name, call, [argument(names) for argument in arguments])
    raise ExpressionError('not arithmetic')


def _called(name: str, call: Callable[..., float], arguments: list[Any]) -> Any:
    if any(isinstance(argument, Signal) for argument in arguments):
        return time_function.call(name, *arguments)
    return columns.each(call, *arguments)


def _constant_or_parameter(name: str) -> Evaluator:
    if name in CONSTANTS:
        value = CONSTANTS[name]
        return lambda names: value
    if name in FUNCTIONS:
        raise ExpressionError(f'{name} is a function and needs its argument in parentheses')

    def look_up(names: Mapping[str, float]) -> float:
        if name in names:
            return names[name]
        raise ExpressionError(
            f'unknown name {shortened(repr(name))}', name, (*names, *CONSTANTS, *FUNCTIONS)
        )

    return look_up

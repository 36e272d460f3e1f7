"""Functions of time with two derivatives, computed by a small machine from a program.

It is compiled once for all programs, and only where a mechanism has any. slots: [instructions,
outputs, (operation, argument, argument or place in params) of each, (place, instruction) of each
output]; params: numbers, and of each table [points, x …, (c₀, c₁, c₂, c₃) of each piece], the
first piece before all points and the last one behind. Registers: (f, ḟ, f̈) of each instruction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.first_switch import RATE
from alf_ros.kernel.numba_ext.jit import by_address
from alf_ros.mechanism.time_function import OPERATIONS, Signal
from alf_ros.splines import cubic_spline

_NUMBER, _TIME, _TABLE, _RATE = range(4)
_SQRT, _SIN, _COS, _TAN, _ASIN, _EXP, _LOG, _ABS = range(4, 12)
_ADD, _SUB, _MUL, _DIV, _POW, _ATAN2, _HYPOT, _MIN, _MAX = range(12, 21)
_CODE = {operation: code for code, operation in enumerate(OPERATIONS)}

_numbers, _integers = types.CPointer(types.float64), types.CPointer(types.int64)


@by_address(types.void(types.float64, _integers, _numbers, _numbers, _numbers, _numbers, _numbers))
def run(
    t: float,
    slots: Integers,
    params: Floats,
    registers: Floats,
    q: Floats,
    qd: Floats,
    qdd: Floats,
) -> None:
    """Write f, ḟ, f̈ of every output at its place in q, q̇, q̈."""
    instructions = slots[0]
    for n in range(instructions):
        code, a, at = slots[2 + 3 * n], 3 * slots[3 + 3 * n], slots[4 + 3 * n]
        u, u1, u2 = registers[a], registers[a + 1], registers[a + 2]
        f, f1, f2 = 0.0, 0.0, 0.0
        v, v1, v2 = 0.0, 0.0, 0.0
        if code >= _ADD:
            v, v1, v2 = registers[3 * at], registers[3 * at + 1], registers[3 * at + 2]
        if code == _NUMBER:
            f = params[at]
        elif code == _TIME:
            f, f1 = t, 1.0
        elif code == _RATE:
            f1, f2 = u, u1
        elif code == _ADD:
            f, f1, f2 = u + v, u1 + v1, u2 + v2
        elif code == _SUB:
            f, f1, f2 = u - v, u1 - v1, u2 - v2
        elif code == _MUL:
            f, f1, f2 = u * v, u1 * v + u * v1, u2 * v + 2.0 * u1 * v1 + u * v2
        elif code == _DIV:
            f = u / v
            f1 = (u1 - f * v1) / v
            f2 = (u2 - 2.0 * f1 * v1 - f * v2) / v
        elif code == _ATAN2:
            s = u * u + v * v
            f = math.atan2(u, v)
            f1 = (u1 * v - u * v1) / s
            f2 = (u2 * v - u * v2 - 2.0 * f1 * (u * u1 + v * v1)) / s
        elif code == _HYPOT:
            f = math.hypot(u, v)
            f1 = (u * u1 + v * v1) / f
            f2 = (u * u2 + v * v2 + u1 * u1 + v1 * v1 - f1 * f1) / f
        elif code == _MIN or code == _MAX:
            first = u <= v if code == _MIN else u >= v
            f, f1, f2 = (u, u1, u2) if first else (v, v1, v2)
        elif code == _POW:
            if v1 == 0.0 and v2 == 0.0:
                f = u**v
                d = v * u ** (v - 1.0) if v != 0.0 else 0.0
                dd = v * (v - 1.0) * u ** (v - 2.0) if v != 0.0 and v != 1.0 else 0.0
                f1, f2 = d * u1, dd * u1 * u1 + d * u2
            else:  # exp(v log u)
                w = math.log(u)
                w1 = u1 / u
                w2 = u2 / u - w1 * w1
                f = u**v
                e1 = v1 * w + v * w1
                f1, f2 = f * e1, f * (e1 * e1 + v2 * w + 2.0 * v1 * w1 + v * w2)
        else:
            d, dd = 0.0, 0.0
            if code == _SIN:
                f, d = math.sin(u), math.cos(u)
                dd = -f
            elif code == _COS:
                f, d = math.cos(u), -math.sin(u)
                dd = -f
            elif code == _TAN:
                f = math.tan(u)
                d = 1.0 + f * f
                dd = 2.0 * f * d
            elif code == _SQRT:
                f = math.sqrt(u)
                d = 0.5 / f
                dd = -0.5 * d / u
            elif code == _EXP:
                f = math.exp(u)
                d = dd = f
            elif code == _LOG:
                f, d = math.log(u), 1.0 / u
                dd = -d * d
            elif code == _ASIN:
                f, d = math.asin(u), 1.0 / math.sqrt(1.0 - u * u)
                dd = u * d * d * d
            elif code == _ABS:
                f = abs(u)
                d = 1.0 if u >= 0.0 else -1.0
            elif code == _TABLE:
                points = int(params[at])
                low, high = 0, points
                while low < high:
                    middle = (low + high) // 2
                    if params[at + 1 + middle] <= u:
                        low = middle + 1
                    else:
                        high = middle
                x = u - params[at + 1 + max(low - 1, 0)]
                c = at + 1 + points + 4 * low
                f = params[c] + x * (params[c + 1] + x * (params[c + 2] + x * params[c + 3]))
                d = params[c + 1] + x * (2.0 * params[c + 2] + x * 3.0 * params[c + 3])
                dd = 2.0 * params[c + 2] + 6.0 * x * params[c + 3]
            f1, f2 = d * u1, dd * u1 * u1 + d * u2
        registers[3 * n], registers[3 * n + 1], registers[3 * n + 2] = f, f1, f2
    outputs = 2 + 3 * instructions
    for n in range(slots[1]):
        place, source = slots[outputs + 2 * n], 3 * slots[outputs + 2 * n + 1]
        q[place] = registers[source]
        qd[place] = registers[source + 1]
        qdd[place] = registers[source + 2]


def program(outputs: Mapping[int, Signal], apart: bool = False) -> tuple[Integers, Floats]:
    """slots and params that compute each signal at its place; equal expressions are computed
    once. `apart`: every number has a place of its own, so that slots do not depend on values."""
    number: dict[Signal | int, int] = {}
    instructions: list[tuple[int, int, int]] = []
    params: list[float] = []

    def add(signal: Signal) -> int:
        known = id(signal) if apart else signal
        if known in number:
            return number[known]
        sources = [add(argument) for argument in signal.arguments]
        first = sources[0] if sources else 0
        last = sources[-1] if sources else 0
        if signal.operation == 'number':
            last = len(params)
            params.append(signal.value)
        elif signal.operation == 'table':
            last = len(params)
            params.extend(_spline(signal))
        instructions.append((_CODE[signal.operation], first, last))
        number[known] = len(instructions) - 1
        return number[known]

    ends = [(place, add(signal)) for place, signal in outputs.items()]
    words = [len(instructions), len(ends), *(w for i in instructions for w in i)]
    slots = np.array([*words, *(w for end in ends for w in end)], dtype=np.int64)
    return slots, np.array(params, dtype=float)


def moves_kink(slots: Integers, changes: Floats) -> bool:
    """Whether abs, min or max depends on numbers that change: (numbers,) by how much each does."""
    changed: list[bool] = []
    for code, first, last in slots[2 : 2 + 3 * int(slots[0])].reshape(-1, 3).tolist():
        if code == _NUMBER:
            changed.append(bool(changes[last] != 0.0))
        elif code == _TABLE:
            changed.append(False)  # its instants are known, and its arguments are t
        else:
            changed.append(code != _TIME and (changed[first] or (code >= _ADD and changed[last])))
        if changed[-1] and code in (_ABS, _MIN, _MAX):
            return True
    return False


def switches(slots: Integers, params: Floats) -> Integers:
    """(2 k,) of each operation on t that may have a corner: the instructions that it compares, -1
    for zero. One branch is for a first number that is not less than the second one.

    Of abs, min and max these are arguments. sqrt, asin, hypot and broken powers have a corner
    where their argument touches the end of its range, as of sqrt(x²): there their own rate changes
    its sign, which is compared with zero (`RATE`).
    """
    depends: list[bool] = []
    found: list[int] = []
    instructions = slots[2 : 2 + 3 * int(slots[0])].reshape(-1, 3).tolist()

    def is_broken(code: int, _: int, at: int) -> bool:
        return code == _NUMBER and params[at] % 1.0 != 0.0

    for n, (code, first, last) in enumerate(instructions):
        of_two = code >= _ADD and depends[last]
        depends.append(code == _TIME or (code != _NUMBER and (depends[first] or of_two)))
        if not depends[-1]:
            continue
        if code in (_ABS, _MIN, _MAX):
            found += [last, first] if code == _MIN else [first, -1 if code == _ABS else last]
        elif code in (_SQRT, _ASIN, _HYPOT) or (code == _POW and is_broken(*instructions[last])):
            found += [n, RATE]
    return np.array(found, dtype=np.int64)


def _spline(signal: Signal) -> list[float]:
    x, f = np.array(signal.points).T
    inner = cubic_spline(x, f, 'clamped').c[::-1].T
    rest = [[f[0], 0.0, 0.0, 0.0], *inner.tolist(), [f[-1], 0.0, 0.0, 0.0]]
    return [float(x.size), *x.tolist(), *(c for piece in rest for c in piece)]

"""Functions of time: their rates, and how these change with their numbers, against the complex
step of the machine that computes them. Every operation is found; one without an example fails by
its name.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

from alf_ros.arrays import Floats
from alf_ros.mechanism import time_function
from alf_ros.mechanism.time_function import BINARY, OPERATIONS, TIME, UNARY, Signal, signal
from alf_ros.model.dual_time_program import dual_run
from alf_ros.model.time_program import program, run
from support.complex_step import along, in_complex, slopes, values

EXACT = 3e-14  # of the largest number: a hundred roundings
T = 0.3  # s

# between 0 and 1, so that every operation knows them, and apart from one another
U = 0.4 + 0.7 * TIME - 0.3 * TIME * TIME
V = 0.9 - 0.5 * TIME + 0.2 * TIME * TIME
EXAMPLES = {
    'number': signal(0.7) * TIME,
    'time': TIME,
    'table': time_function.table([(0.0, 0.1), (0.2, 0.5), (0.5, -0.3), (0.9, 0.8)]),
    'rate': time_function.rate(U * V),
    **{name: Signal(name, (U,)) for name in UNARY},
    **{name: Signal(name, (U, V)) for name in BINARY},
    'abs of less than 0': Signal('abs', (U - 2.0,)),
    'min of a larger one': Signal('min', (V, U)),
    'max of a larger one': Signal('max', (V, U)),
    'atan2 behind': Signal('atan2', (U, V - 2.0)),
    'pow to a number': Signal('pow', (U, signal(2.5))),
    'pow of less than 0': Signal('pow', (U - 2.0, signal(3.0))),
    'pow of a number': Signal('pow', (signal(1.7), V)),
    'several': Signal('sin', (U * V,)) / Signal('hypot', (V, signal(0.4))) - Signal('exp', (U,)),
}


def _in_complex(slots: Any, t: Any, params: Any) -> tuple[Floats, Floats]:
    """f, ḟ, f̈ as the machine is written, and their slopes."""
    registers: list[Any] = 3 * int(slots[0]) * [0.0]
    found: list[list[Any]] = [[0.0], [0.0], [0.0]]
    in_complex(run._pyfunc)(t, slots.tolist(), params, registers, *found)
    flat = [each for (each,) in found]
    return values(flat), slopes(flat)


def _compiled(slots: Any, params: Floats, changes: Floats) -> tuple[Floats, Floats]:
    """f, ḟ, f̈, and their slopes along changes of the numbers."""
    doubles, words = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
    registers, found = np.zeros((2, 3 * int(slots[0]))), np.zeros((3, 2, 1))
    pairs = ((params, changes), registers, *found)
    pointers = [each.ctypes.data_as(doubles) for pair in pairs for each in pair]
    dual_run().ctypes(T, slots.ctypes.data_as(words), *pointers)
    plain, memory = np.zeros((3, 1)), np.zeros(3 * int(slots[0]))
    given = [each.ctypes.data_as(doubles) for each in (params, memory, *plain)]
    run.ctypes(T, slots.ctypes.data_as(words), *given)
    np.testing.assert_array_equal(found[:, 0], plain)
    return plain[:, 0], found[:, 1, 0]


@pytest.mark.parametrize('name', EXAMPLES)
def test_rates_and_slopes(name: str) -> None:
    slots, params = program({0: EXAMPLES[name]}, apart=True)
    numbers = np.where(params != np.round(params), params, 0.0)  # none of the counts of a table
    changes = np.random.default_rng(11).normal(size=params.size) * numbers
    found, slope = _compiled(slots, params, changes)
    scale = EXACT * max(1.0, float(np.abs(np.append(found, slope)).max()))
    start = 1 if name == 'rate' else 0  # only its rates count
    time = along(np.array([T]), np.ones(1))[0]
    exact, rates = _in_complex(slots, time, params.tolist())
    assert found == pytest.approx(exact, rel=0, abs=scale)
    assert found[start + 1 :] == pytest.approx(rates[start:2], rel=0, abs=scale)
    _, exact = _in_complex(slots, T, along(params, changes))
    assert slope == pytest.approx(exact, rel=0, abs=scale)
    assert np.abs(slope).max() > 1e-3 or name == 'time'


@pytest.mark.parametrize('operation', OPERATIONS)
def test_every_operation_has_an_example(operation: str) -> None:
    assert operation in EXAMPLES, f'{operation}: no example with its rates'


def test_the_examples_are_of_their_operations() -> None:
    for name, function in EXAMPLES.items():
        operation = {'number': 'mul', 'several': 'sub'}.get(name, name.partition(' ')[0])
        assert function.operation == operation

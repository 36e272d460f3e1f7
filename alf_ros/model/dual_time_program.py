"""Functions of time along changes of their numbers: `time_program.run` for dual numbers."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.dual_numbers import duals
from alf_ros.kernel.numba_ext.jit import by_address, shared
from alf_ros.kernel.numba_ext.lane_numbers import LanesType
from alf_ros.model.time_program import run

_DOUBLES, _WORDS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
_numbers, _integers = types.CPointer(types.float64), types.CPointer(types.int64)


@cache
def dual_run(lanes: int = 0) -> Any:
    """`run` along so many directions at once, as a C function (t, slots, params, δparams,
    registers, δregisters, q, δq, q̇, δq̇, q̈, δq̈); the arrays of changes are (numbers, lanes).
    Without `lanes` along one direction; then they are (numbers,)."""
    inside = shared(run._pyfunc, forceinline=True)

    def both(
        t: float,
        slots: Integers,
        params: Floats,
        dparams: Floats,
        registers: Floats,
        dregisters: Floats,
        q: Floats,
        dq: Floats,
        qd: Floats,
        dqd: Floats,
        qdd: Floats,
        dqdd: Floats,
    ) -> None:
        inside(
            t,
            slots,
            duals(params, dparams),
            duals(registers, dregisters),
            duals(q, dq),
            duals(qd, dqd),
            duals(qdd, dqdd),
        )

    pair = (_numbers, types.CPointer(LanesType(lanes, fused=True) if lanes else types.float64))
    return by_address(types.void(types.float64, _integers, *(5 * pair)), of=run._pyfunc)(both)


def put_slopes(
    slots: Integers, params: Floats, changes: Floats, t: float, dq: Floats, dqd: Floats
) -> None:
    """Write how the outputs of a program and their rates at t (s) change along `changes` of its
    numbers, at their places in dq and dqd (blocks D)."""
    registers = np.zeros((2, 3 * int(slots[0])))
    unused = np.zeros((2, dq.size))
    pairs = ((params, changes), registers, (unused[0], dq), (unused[0], dqd), unused)
    pointers = [x.ctypes.data_as(_DOUBLES) for pair in pairs for x in pair]
    dual_run().ctypes(t, slots.ctypes.data_as(_WORDS), *pointers)

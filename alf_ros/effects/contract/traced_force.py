"""The derivatives of all forces of an effect at once, weighted: its `force`, compiled for traced
numbers.

As for dual numbers (`dual_force`), the function of the effect is the only source.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import types
from numba.core.errors import NumbaError

from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract.dual_force import without_derivative
from alf_ros.kernel.numba_ext.jit import by_address, shared
from alf_ros.kernel.numba_ext.traced_numbers import arguments, sums

_numbers, _integers = types.CPointer(types.float64), types.CPointer(types.int64)
TRACED_FORCE = types.void(
    types.float64,
    *(3 * [_numbers]),
    _integers,
    _numbers,
    *(3 * [_integers]),
    _numbers,
    _integers,
    _numbers,
    _integers,
    _numbers,
)


@cache
def traced_force(function: Callable[..., None]) -> Any:
    """`force(t, q, qd, near, slots, params, Q)` of an effect, the plain function, as a C function
    (t, q, qd, near, slots, params, of_q, of_qd, of_params, Q, made, along, words, slopes).

    It adds into Q and writes the trace of Q into words and slopes (`traced_numbers`). of_q, of_qd,
    of_params: the numbers of the arguments, -1 for a constant; made, along: the number that each
    of Q follows from, and the slope along it. Raises TypeError where it does not compile for
    traced numbers.
    """
    inside = shared(function)

    def traced(
        t: float,
        q: Floats,
        qd: Floats,
        near: Floats,
        slots: Integers,
        params: Floats,
        of_q: Integers,
        of_qd: Integers,
        of_params: Integers,
        Q: Floats,
        made: Integers,
        along: Floats,
        words: Integers,
        slopes: Floats,
    ) -> None:
        inside(
            t,
            arguments(q, of_q, words, slopes),
            arguments(qd, of_qd, words, slopes),
            near,
            slots,
            arguments(params, of_params, words, slopes),
            sums(Q, made, along, words, slopes),
        )

    try:
        return by_address(TRACED_FORCE, of=function)(traced)
    except NumbaError as error:
        raise TypeError(without_derivative(str(error))) from None

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
    *(2 * [types.int64]),
    _numbers,
    *(2 * [_integers]),
    _numbers,
)


@cache
def traced_force(function: Callable[..., None]) -> Any:
    """`force(t, q, qd, near, slots, params, Q)` of an effect, the plain function, as a C function
    (t, q, qd, near, slots, params, numbers, first, Q, made, words, slopes).

    It adds into Q and writes the trace of Q into words and slopes (`traced_numbers`). q and qd
    have `numbers` arguments each, the first of params has the number `first`; made: the number of
    what made each of Q. Raises TypeError where it does not compile for traced numbers.
    """
    inside = shared(function)

    def traced(
        t: float,
        q: Floats,
        qd: Floats,
        near: Floats,
        slots: Integers,
        params: Floats,
        numbers: int,
        first: int,
        Q: Floats,
        made: Integers,
        words: Integers,
        slopes: Floats,
    ) -> None:
        inside(
            t,
            arguments(q, 0, words, slopes),
            arguments(qd, numbers, words, slopes),
            near,
            slots,
            arguments(params, first, words, slopes),
            sums(Q, made, words, slopes),
        )

    try:
        return by_address(TRACED_FORCE, of=function)(traced)
    except NumbaError as error:
        raise TypeError(without_derivative(str(error))) from None

"""∂Q of an effect along a direction: its `force`, compiled for dual numbers.

The function of the effect is the only source: its own statements are differentiated. An effect
needs no second formula, so none can be wrong. Tangents of a run refuse
an effect whose functions do not compile for dual numbers, because they call something that
`dual_numbers` does not know; statics takes differences for it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import Any

from numba import types
from numba.core.errors import NumbaError

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.dual_numbers import duals
from alf_ros.kernel.numba_ext.jit import by_address, shared
from alf_ros.kernel.numba_ext.lane_numbers import LanesType

_numbers, _integers = types.CPointer(types.float64), types.CPointer(types.int64)


def _signature(slope: Any) -> Any:
    slopes = types.CPointer(slope)
    state = (_numbers, slopes, _numbers, slopes, _numbers)
    return types.void(types.float64, *state, _integers, *(2 * [_numbers, slopes]))


@cache
def dual_force(function: Callable[..., None], lanes: int = 0) -> Any:
    """`force(t, q, qd, near, slots, params, Q)` of an effect, the plain function, as a C function
    (t, q, δq, qd, δqd, near, slots, params, δparams, Q, δQ) that adds into Q and δQ.

    `lanes`: along so many directions at once; the arrays of slopes are (numbers, lanes). Raises
    TypeError where it does not compile for dual numbers.
    """
    inside = shared(function, forceinline=True)

    def both(
        t: float,
        q: Floats,
        dq: Floats,
        qd: Floats,
        dqd: Floats,
        near: Floats,
        slots: Integers,
        params: Floats,
        dparams: Floats,
        Q: Floats,
        dQ: Floats,
    ) -> None:
        inside(t, duals(q, dq), duals(qd, dqd), near, slots, duals(params, dparams), duals(Q, dQ))

    try:
        slope = LanesType(lanes, fused=True) if lanes else types.float64
        return by_address(_signature(slope), of=function)(both)
    except NumbaError as error:
        raise TypeError(without_derivative(str(error))) from None


def without_derivative(text: str) -> str:
    """The line of a message of numba that says which function it is."""
    unknown = re.search(r"Unknown attribute '(\w+)'|>>> (\w+)\(", text)
    name = next(filter(None, unknown.groups()), None) if unknown else None
    return 'no derivative of its function' + (f' {name}' if name else '')

"""Q of an effect for several members at once: its `force`, compiled for lanes.

The function of the effect is the only source. Where the members take different branches of it, it
says so, and is called for one after another instead. An effect whose function does not compile for
lanes is always called so.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from numba import types
from numba.core.errors import NumbaError

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.branching_lanes import begin, branching, finish
from alf_ros.kernel.numba_ext.jit import by_address, shared
from alf_ros.kernel.numba_ext.lane_numbers import LanesType

_integers = types.CPointer(types.int64)


@cache
def lane_force(function: Callable[..., None], W: int) -> int:
    """`force(t, q, qd, near, slots, params, Q)` of an effect, the plain function, for W members:
    the address of a C function (t, q, qd, near, slots, params, Q, parted). All but `slots` are
    pointers to lanes, t to one number; `parted` points to a whole number, which becomes 0; or
    another one where the members take different branches, or where the function of one raises an
    exception. Q has no use then. 0 if it does not compile for lanes.
    """
    # no lists: lanes in them would not stand where the processor wants registers to be
    inside = shared(function, forceinline=True, _nrt=False)

    def of_all(
        t: Floats,
        q: Floats,
        qd: Floats,
        near: Floats,
        slots: Integers,
        params: Floats,
        Q: Floats,
        parted: Integers,
    ) -> None:
        begin(parted)
        inside(
            branching(t, parted)[0],
            branching(q, parted),
            branching(qd, parted),
            branching(near, parted),
            slots,
            branching(params, parted),
            branching(Q, parted),
        )
        finish(parted)

    lanes = types.CPointer(LanesType(W))
    signature = types.void(lanes, lanes, lanes, lanes, _integers, lanes, lanes, _integers)
    try:
        return int(by_address(signature, of=function, _nrt=False)(of_all).address)
    except NumbaError:
        return 0

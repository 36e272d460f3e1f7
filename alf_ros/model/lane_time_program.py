"""Functions of time of several members at once: `time_program.run` for lanes."""

from __future__ import annotations

from functools import cache

from numba import types

from alf_ros.arrays import Floats, Integers
from alf_ros.kernel.numba_ext.branching_lanes import begin, branching, finish
from alf_ros.kernel.numba_ext.jit import by_address, shared
from alf_ros.kernel.numba_ext.lane_numbers import LanesType
from alf_ros.model.time_program import run


@cache
def lane_run(W: int) -> int:
    """`run` of W members: the address of a C function (t, slots, params, registers, q, q̇, q̈,
    parted). All but `slots` are pointers to lanes, t to one number; `parted` as of `lane_force`.
    """
    inside = shared(run._pyfunc, forceinline=True)

    def of_all(
        t: Floats,
        slots: Integers,
        params: Floats,
        registers: Floats,
        q: Floats,
        qd: Floats,
        qdd: Floats,
        parted: Integers,
    ) -> None:
        begin(parted)
        inside(
            branching(t, parted)[0],
            slots,
            branching(params, parted),
            branching(registers, parted),
            branching(q, parted),
            branching(qd, parted),
            branching(qdd, parted),
        )
        finish(parted)

    lanes, integers = types.CPointer(LanesType(W)), types.CPointer(types.int64)
    signature = types.void(lanes, integers, *5 * [lanes], integers)
    return int(by_address(signature, of=run._pyfunc)(of_all).address)

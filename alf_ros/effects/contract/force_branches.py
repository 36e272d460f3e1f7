"""The branches of an effect without a `side`: its `force`, compiled for branch numbers.

Derivatives of a run need to know where a force has a kink or jumps. The function of the effect is
the only source: what it compares tells its branches.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from numba.core.errors import NumbaError

from alf_ros.arrays import Floats, Integers
from alf_ros.effects.contract import SIDE
from alf_ros.kernel.numba_ext.branch_numbers import branch_number, new_note, unread, watched
from alf_ros.kernel.numba_ext.jit import by_address, shared


@cache
def force_branches(function: Callable[..., None], over_time: bool) -> int:
    """`force(t, q, qd, near, slots, params, Q)` of an effect, the plain function, as a `side`:
    the address of a function that gives another number on the other side of a branch by the
    motion, or `over_time`. 0 if it has no derivative, of which a message tells elsewhere.
    """
    inside = shared(function)

    def branches(
        t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats
    ) -> float:
        note = new_note()
        moving = watched(q, note), watched(qd, note)
        when = branch_number(t, note) if over_time else t
        inside(when, *moving, near, slots, params, unread(note))
        return float(note[0])

    variant = '-over-time' if over_time else '-by-motion'
    try:
        return int(by_address(SIDE, of=function, variant=variant)(branches).address)
    except NumbaError:
        return 0

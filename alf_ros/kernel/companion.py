"""The companion of the steps of a run: tangents that follow them, or a record of them.

It is one function, called by its address, with the struct that it fills. So runs with and without
a companion share the machine code of their steps, and a width of the tangents compiles only what
depends on it. Nothing that the steps read is written by it: they have the same bits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.numba_ext.calls import call_for_number, call_for_whole, struct_at_address
from alf_ros.kernel.numba_ext.jit import ONE, TWO, ZERO, expanded, inlined
from alf_ros.kernel.status import OK

# What a companion is told, with a stage s, a time t (s) and a distance x to a singular position:
BEGIN_CALL = np.uint64(0)  # steps begin, at the phase
FIRST_STAGE = np.uint64(1)  # -λ of the begin of a step stands in `work`
BEGIN_STEP = np.uint64(2)  # the coordinates of a step are chosen; s: 1 if its first stage is kept
STAGE = np.uint64(3)  # q, q̇, q̈, -λ and factor of stage s at t stand in `work`
ADDED_UP = np.uint64(4)  # q and p' of the end, at t, stand in `work`, before it is put on Φ = 0
END_STEP = np.uint64(5)  # the step has ended in `work`, and is to be accepted; x: σ as of `step`


def told(of: Any, dimension: int) -> Any:
    """The signature of a companion that fills a struct of this type."""
    structs = of, Problem._numba_type(dimension), Phase._numba_type()
    numbers = types.uint64, types.uint64, types.float64, types.float64
    return types.int64(*structs, *numbers)


@inlined
def is_accompanied(problem: Problem) -> bool:
    """Whether steps of a problem have a companion."""
    return problem.work.companion.size > 0


@inlined
def tell(problem: Problem, phase: Phase, what: np.uint64, s: np.uint64, t: float, x: float) -> int:
    """Tell the companion of a step, if there is one; returns its result. Begin, end and length of
    the step stand in `work.interval`."""
    work = problem.work
    if work.companion.size == ZERO:
        return OK
    of = struct_at_address(work.companion[ONE])
    return call_for_whole(work.companion[ZERO], of, problem, phase, what, s, t, x)


@expanded
def begin_interval(problem: Problem, t: float, end: float, h: float) -> None:
    """Begin a step of h (s) from t to `end`."""
    interval = problem.work.interval
    interval[ZERO], interval[ONE], interval[TWO] = t, end, h


@inlined
def part_to_kink(
    problem: Problem, phase: Phase, t: float, h: float, whole: float, across: float
) -> float:
    """`crossed_kinks.crossed`, where steps end at kinks that are crossed; else 1."""
    work = problem.work
    if work.divider.size == ZERO:
        return 1.0
    return call_for_number(work.divider[ZERO], problem, phase, t, h, whole, across)

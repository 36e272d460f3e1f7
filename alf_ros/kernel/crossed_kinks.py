"""Steps with derivatives end at the kinks of forces that the motion crosses.

A force that has a kink acts on the motion as smoothly as on both sides of it, but its derivatives
jump. A step across the kink gives them an error of first order in h, where the motion has one of
second order or less. So such a step is taken in pieces: towards the crossing, each ends where
`_LEFT` of the way to it is left, so that no stage goes too far. Only a piece of `_TINY` goes
across, and behind it they grow, as slopes may change fast beside a crossing. The place of the
crossing is read from the motion between the ends of a step, as for kinks that are met and left
(`grazed_kinks`), in shorter and shorter steps.

A motion that begins at a kink, as at rest on the edge of a stop, comes no nearer in such pieces:
each moves it by less than rounding, or to another side. So the piece that goes across grows with
the number of pieces.

A force that jumps there would leave the derivatives an error of the size of the jump, which nobody
would see. So both sides are compared in the piece that goes across, and such a run ends.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types

from alf_ros.arrays import Floats
from alf_ros.kernel.applied_forces import add_one, sides
from alf_ros.kernel.data import Phase, Problem
from alf_ros.kernel.grazed_kinks import end_in_arcs, keep_end, place, restore_end
from alf_ros.kernel.numba_ext.jit import ONE, TWO, by_address, inlined, inner
from alf_ros.kernel.numba_ext.vectors import largest, zero

_TINY = 1e-9  # of a step of the grid
_USUAL = 40  # how often a step is shortened where it crosses one kink, at most
_LEFT = 0.25  # of the way to the crossing
_GROWS = 3.0  # times the time since the crossing
_EARLY = 0.25  # part of a step: a crossing in it is looked for again in a shorter one,
_AGAIN = 3.0  # so many times as long as the way to it
_HALVINGS = 44
_JUMPS = 1e-6  # of the forces: what is more is no rounding
_FELT = 1e-9  # of the force that would stop the motion within a step of the grid


def crossed(
    problem: Problem, phase: Phase, t: float, h: float, whole: float, across: float
) -> float:
    """The part of the step of h (s) from `phase` at t (s), which ended in `work`, at which the
    motion has come to the other side of a kink; 1 if it stays, -1 if a force jumps there: the
    number of its kind stands in `work.divider` then, and 1 if it jumps over time. whole: the step
    of the grid, s. across: the length of a piece that goes across a kink, s.

    Needs q, q̇ of the end and the rates of the stages in `work`. Leaves q and q̇ there.
    """
    effects, work = problem.forces.effects, problem.work
    if effects.side.size == 0:
        return 1.0
    before = sides(effects, t, phase.q, phase.qd, work.near)
    if sides(effects, t + h, work.q, work.qd, work.near) == before:
        return 1.0
    low, high = 0.0, 1.0
    keep_end(problem)
    end_in_arcs(problem, h)
    for _ in range(_HALVINGS):
        part = 0.5 * (low + high)
        place(problem, phase, t, h, part, 1.0)
        if sides(effects, t + part * h, work.q, work.qd, work.near) == before:
            low = part
        else:
            high = part
    jumps = h <= 2.0 * across and _one_jumps(problem, phase, t, h, whole, low, high)
    restore_end(problem)
    return -1.0 if jumps else min(high, 1.0 - 1e-12)


@inner
def _one_jumps(
    problem: Problem, phase: Phase, t: float, h: float, whole: float, low: float, high: float
) -> bool:
    """Whether a force is another one at two parts of a step: at one instant, or also at both
    instants if its own are not told."""
    effects, work = problem.forces.effects, problem.work
    before, behind = work.delta, work.given
    n = work.p.size
    felt = _JUMPS * largest(work.Q, n) + _FELT * largest(work.p, n) / whole
    for e in range(effects.side.size):
        if effects.side[e] != 0:
            zero(before)
            zero(behind)
            place(problem, phase, t, h, high, 1.0)
            add_one(effects, e, t, work.q, work.qd, work.near, behind)
            place(problem, phase, t, h, low, 1.0)
            add_one(effects, e, t, work.q, work.qd, work.near, before)
            if _differ(before, behind, n, felt):
                work.divider[ONE], work.divider[TWO] = e, 0
                return True
            if effects.undated[e] != 0:
                zero(before)
                zero(behind)
                add_one(effects, e, t + low * h, work.q, work.qd, work.near, before)
                add_one(effects, e, t + high * h, work.q, work.qd, work.near, behind)
                if _differ(before, behind, n, felt):
                    work.divider[ONE], work.divider[TWO] = e, 1
                    return True
    return False


@inlined
def _differ(before: Floats, behind: Floats, n: int, felt: float) -> bool:
    """Whether one of the first n numbers changes by more than `felt`."""
    for i in range(n):
        if abs(behind[i] - before[i]) > felt:
            return True
    return False


@cache
def divider(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Work` holds."""
    structs = Problem._numba_type(dimension), Phase._numba_type()
    return by_address(types.float64(*structs, *(4 * (types.float64,))))(crossed)


@inlined
def passed(since: float, part: float, h: float) -> float:
    """The time (s) since a kink was crossed, after a step of h that crossed one at a part of it;
    0 where none was."""
    return h if part < 1.0 else (since + h if since > 0.0 else 0.0)


@inlined
def across_kinks(cuts: int, whole: float) -> float:
    """How long (s) a piece is that goes across a kink, where the step of the grid of `whole` (s)
    was shortened so often."""
    return _TINY * 2.0 ** (cuts // _USUAL) * whole


@inlined
def next_aim(done: float, since: float, h: float) -> float:
    """Where (s) the next piece of a step of the grid of h ends."""
    aim = done + _GROWS * since
    return aim if since > 0.0 and aim + since < h else h


@inner
def shorter(part: float, h: float, across: float) -> float:
    """How long (s) a step of h is instead, that crosses a kink at a part of it: h if it is short
    enough; across: the length of a piece that goes across."""
    if part == 1.0 or h <= 2.0 * across:
        return h
    if part < _EARLY:
        return max(_AGAIN * part * h, across)
    return (1.0 - _LEFT) * part * h

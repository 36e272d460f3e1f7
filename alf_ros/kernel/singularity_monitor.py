"""The singularity monitor: softest modes, followed from step to step if a run is watched.

It is called through a function pointer, so that a run that nobody watches does not compile it, and
both kinds of runs share the code of their steps.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from alf_ros.arrays import Floats, Unit
from alf_ros.kernel.constraints import jacobian_rate
from alf_ros.kernel.data import Modes, Phase, Problem, System, Work
from alf_ros.kernel.numba_ext.block import block, dot
from alf_ros.kernel.numba_ext.calls import call
from alf_ros.kernel.numba_ext.jit import ONE, by_address, compiled, expanded, inner
from alf_ros.kernel.numba_ext.plain_loops import each
from alf_ros.kernel.numba_ext.vectors import copy
from alf_ros.kernel.softest_modes import STIFF, carried_over, softest

_STEADY = 0.5  # part of itself to which σ may fall in a step, or from which it may rise, at most
_TURN = 0.7  # rad that rows may turn in a step


@compiled
def follow(
    unit: Unit, system: System, work: Work, modes: Modes, rounds: int, tolerance: float
) -> bool:
    """The modes from their last place to the one of the factor in `work`, where `softest` finds
    them; returns whether their σ changed so little that none can have vanished on the way."""
    steady = _is_steady(unit, system, work, modes, work.gf, work.g2f)
    copy(modes.g, modes.gb)
    copy(modes.g2, modes.g2b)
    softest(unit, system, work, modes, rounds, tolerance)
    return _is_steady(unit, system, work, modes, modes.gb, modes.g2b) and steady


@inner
def _is_steady(
    unit: Unit, system: System, work: Work, modes: Modes, g: Floats, g2: Floats
) -> bool:
    """Whether σ of each mode is about the same where Φ_q is g, g2."""
    steady = True
    for i in range(modes.s2.size):
        if i == 0 or modes.sigma[i] < STIFF:
            ratio = carried_over(unit, system, work, modes, g, g2, i)
            steady = steady and _STEADY <= ratio <= 1.0 / _STEADY
    return steady


@expanded
def is_watched(work: Work) -> bool:
    """Whether modes are followed in a run with this workspace."""
    return work.follow.size > 0


@expanded
def may_have_passed(problem: Problem, phase: Phase, t: float) -> bool:
    """In a watched run, follow the modes to the end of a step, at t, with the factor in `work`;
    returns whether a singular position may have been passed in the step."""
    work = problem.work
    call(work.follow, problem, phase, t)
    return is_watched(work) and work.watch.look[0] == 1


def _follow_step(problem: Problem, phase: Phase, t: float) -> None:
    """Set `look` to 1 if a singular position may have been passed in a step, else to 0.

    If σ of each mode is steady and no row turns far, in this step and in the one before, no
    position can have been passed. The step before counts because a mechanism may turn back just
    behind a singular position: then only that step shows the pass.
    """
    unit, system, work, watch = problem.unit, problem.system, problem.work, problem.work.watch
    quiet = watch.quiet[0]
    _copy_phase(watch.after, watch.before)
    _copy_phase(phase, watch.after)
    watch.t[0], watch.t[1] = watch.t[1], t
    rate = turning(unit, system, watch.g2d, phase.qd)
    furthest = max(rate, watch.rate[0]) * (watch.t[1] - watch.t[0])
    watch.rate[0] = rate
    steady = follow(unit, system, work, watch.modes, 1, 0.0) and furthest <= _TURN
    watch.quiet[0] = 1 if steady else 0
    watch.look[0] = 1 if quiet == 0 or not steady else 0


@cache
def follow_step(dimension: int) -> Any:
    """The compiled function for 2 or 3 dimensions; its `address` is what `Work` holds."""
    structs = Problem._numba_type(dimension), Phase._numba_type()
    return by_address(types.void(*structs, types.float64))(_follow_step)


@inner
def _copy_phase(of: Phase, to: Phase) -> None:
    copy(of.q, to.q)
    copy(of.qd, to.qd)
    copy(of.turns, to.turns)
    copy(of.pace, to.pace)
    copy(of.works, to.works)


@compiled
def turning(unit: Unit, system: System, g2d: Floats, qd: Floats) -> float:
    """How fast the rows of Φ_q change beside their length as drawn, at most, 1/s."""
    rows, square = system.rows, 0.0
    for r in each(0, rows.i.size):
        d = block(unit, qd, rows.i[r]) - block(unit, qd, rows.j[r])
        square = max(square, rows.scale[r] ** 2 * dot(d, d))
    jacobian_rate(unit, rows, qd, g2d)
    for r in each(0, rows.movable.size):
        s = 0.0
        for e in each(rows.first[r], rows.first[r + ONE]):
            s += dot(block(unit, g2d, e), block(unit, g2d, e))
        square = max(square, rows.scale[rows.i.size + r] ** 2 * s)
    return float(np.sqrt(square))

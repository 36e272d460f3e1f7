"""The error of a step of an adaptive method, and the length of the next one.

For a single mechanism and for lanes, where each member has a length of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.arc_coordinates import straighten, straighten_momenta
from alf_ros.kernel.data import EPS, NOTHING, Method, Phase, System, Work
from alf_ros.kernel.interpolated_stages import SPACING
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import ONE, THREE, TWO, ZERO, inlined, inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, everywhere, pick
from alf_ros.kernel.numba_ext.vectors import copy, largest, zero

SHARE = 0.05  # of the tolerance for one step: errors add up along a motion
LEAP = 100.0  # times: an error that exceeds the previous one by so much belongs to a kink
TURN = 1.5  # rad that an arm may turn in a step, so that turns can be counted
MOST = 20_000  # steps between two grid points: more is stiff, and would look like a hang
SHORTEST = 1e-9  # part of the step of the grid
ACROSS = 0.1  # part of the coarse error that counts where a kink is known to be in the step
_ROUNDED = EPS  # over x²: relative error of a step that may be rounding …
_FLAT = 1e-14  # … far from singular positions, over the ordinary σ …
_MOST_ROUNDED = 1e-10  # … and at most; ten times more if it stays
_DECAY = 2.5  # an error of order h⁴ that falls by less than this power of h belongs to a kink
_MARGIN = 4.0  # as rounding is different in every step


@inner
def embedded(method: Method, work: Work, rate: np.uint64, which: int, h: float) -> None:
    """sum = the embedded error `which` of the variable with rate number `rate` in `work.k`."""
    out, stages = work.sum, method.b.size
    n = out.size
    zero(out)
    for s in range(stages):
        factor = method.embedded[which * stages + s]
        if factor != 0.0:
            weight, first = h * factor, (THREE * s + rate) * n
            for i in range(n):
                out[i] += weight * work.k[first + i]


@inner
def relative(system: System, displacement: float, velocity: float, speed: float) -> float:
    """The larger of an error (m) relative to the size and one (m/s) relative to the speed."""
    worst = displacement / system.size
    faster = velocity > worst * speed  # nothing is, at rest where nothing pulls
    if anywhere(faster):
        worst = pick(faster, velocity / speed, worst)
    return worst


@inner
def usual_speed(system: System, work: Work, phase: Phase) -> float:
    """The speed (m/s) that errors are relative to, of the step that ended in `work`."""
    n = work.p.size
    pull = largest(work.Q, n) / system.mean
    fastest = max(largest(phase.qd, n), largest(work.qd, n))
    return max(fastest, np.sqrt(system.size * pull))


@inner
def displacement_error(
    unit: Unit, system: System, method: Method, work: Work, which: int, h: float
) -> None:
    """p = M times the embedded error `which` of q, of the step of h that ended in `work`."""
    embedded(method, work, ZERO, which, h)
    straighten(unit, system.arms, work.chart, work.sum)
    zero(work.p)
    add_mass_times(unit, system.mass, 1.0, work.sum, work.p)


@inner
def momentum_error(
    unit: Unit, system: System, method: Method, work: Work, which: int, h: float
) -> None:
    """p = the embedded error `which` of the momenta, likewise. Without arcs they are M q̇."""
    p, arcs = work.p, work.chart.arcs[0] > 0
    if anywhere(arcs):
        embedded(method, work, TWO, which, h)
        copy(work.sum, p)
        straighten_momenta(unit, system.arms, work.chart, p)
        if everywhere(arcs):
            return
        copy(p, work.sum_q)
    embedded(method, work, ONE, which, h)
    zero(p)
    add_mass_times(unit, system.mass, 1.0, work.sum, p)
    if anywhere(arcs):
        for i in range(p.size):
            p[i] = pick(arcs, work.sum_q[i], p[i])


@inlined
def joined(fine: float, coarse: float) -> float:
    """Both errors as Hairer, Nørsett & Wanner (1993), II.10, join them for DOP853: of order h⁸, if
    the motion is smooth."""
    some = max(fine, NOTHING)
    return pick(fine > NOTHING, some * some / np.sqrt(some * some + 0.01 * coarse * coarse), 0.0)


@inlined
def likely_rounding(system: System, nearest: float) -> float:
    """Relative error of a step up to which it may be rounding; `nearest`: the distance x of its
    stages to a singular position."""
    x = max(nearest, SPACING * system.close)  # nearer ones are interpolated from there
    return min(_MOST_ROUNDED, _FLAT / system.ordinary + _ROUNDED / (x * x))


class Last(NamedTuple):
    """The last step, with which the next one is compared; numbers, or lanes."""

    expected: float  # the most that the coarse error is without a kink, with its length
    fine: float  # its error of order h⁶, if it was refused
    tries: float  # how many steps from here were refused
    ratio: float  # the length of this step, in parts of its length


@inner
def judged(
    fine: float, coarse: float, share: float, likely: float, across: bool, floor: float, last: Last
) -> tuple[float, float, float]:
    """(error, factor for the next length, floor) of a step from its errors of order h⁶ and h⁴, in
    parts of `share`.

    likely: relative error that may be rounding. across: whether a kink of the forces is known to
    be in the step. floor: the error up to which steps are accepted.
    """
    error = joined(fine, coarse)
    error = pick(across, max(fine, ACROSS * coarse), error)
    steepest = pick(last.tries > 0, _DECAY, 4.0)
    error = pick(coarse > last.expected * last.ratio**steepest, max(fine, coarse), error)
    part = error / floor
    factor = min(5.0, max(0.2, 0.8 * max(part, NOTHING) ** (-1.0 / 8.0)))
    factor = pick(part > 0.0, factor, 5.0)
    # the error of a method falls as h⁸, rounding as h: then a shorter step is no better
    stays = last.tries > 0
    if anywhere(stays):
        stays = stays & (fine > last.fine * last.ratio**1.5) & (error > floor)
        stays = stays & (fine * share < likely * pick(last.tries < 2, 1.0, 10.0))
        floor, factor = pick(stays, _MARGIN * error, floor), pick(stays, 1.0, factor)
    return error, factor, floor


@inlined
def parts_of(left: float, longest: float) -> float:
    """In how many equal steps to go `left`, each at most `longest`: no crumb at the grid point."""
    return max(1.0, np.ceil(0.999999 * left / longest))


@inlined
def next_pace(pace: float, h: float, factor: float) -> float:
    """The longest next step, after one of h that was accepted."""
    return pick(h < pace, max(pace, factor * h), factor * h)

"""The errors of the steps of a group: `step_error.judge` for lanes, and the embedded errors of
an adaptive method."""

from __future__ import annotations

from typing import Any

import numpy as np

from alf_ros.arrays import Unit
from alf_ros.kernel.arc_coordinates import straighten
from alf_ros.kernel.data import NOTHING, Method, Phase, System, Until, Work
from alf_ros.kernel.effect_jacobians import add_soft_times
from alf_ros.kernel.lanes.lane_solve import augmented_lanes
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.numba_ext.jit import inner
from alf_ros.kernel.numba_ext.lane_numbers import anywhere, pick, unless
from alf_ros.kernel.numba_ext.vectors import largest, zero
from alf_ros.kernel.step_error import (
    FINEST,
    SINCE,
    TELLS,
    embedded_difference,
    embedded_errors,
    lost_lately,
    remember,
)
from alf_ros.kernel.step_length import (
    displacement_error,
    momentum_error,
    relative,
    usual_speed,
)

Lanes = Any
Mask = Any


@inner
def judge_lanes(
    unit: Unit, system: System, method: Method, work: Work, h: float, good: Mask
) -> Mask:
    """Note the errors of the steps of h (s) that ended in `work`, where `good` holds; returns
    where the errors of the last steps do not exceed the mechanism."""
    if method.estimate.size == 0:
        return good
    high, low, first = embedded_errors(method, work)
    matters = high > NOTHING
    part = high * high / (high * high + low * low)
    error = high * part
    moved = h * h * (max(high, method.lasting * low) * part) / system.size
    moved = pick(matters, moved, 0.0)
    sharp = matters & (error > method.sharp * first)
    told = good & matters & ((moved > TELLS) | (sharp & (moved > FINEST)))
    if anywhere(told):
        embedded_difference(method, work)
        straighten(unit, system.arms, work.chart, work.sum)
        zero(work.p)
        add_mass_times(unit, system.mass, 1.0, work.sum, work.p)
        add_soft_times(unit, system.soft, 1.0, work.sum, work.p)
        moved = pick(told, moved * (lane_free_part(unit, system, work, told) / high), moved)
    moved = pick(matters & unless(moved < 1.0), 1.0, moved)
    good = good & unless(lost_lately(work.judged, moved) > 1.0)
    since = work.judged[SINCE]
    work.judged[SINCE] = pick(good, since + h, since)
    remember(work.judged, moved, method.caution, sharp & (moved > FINEST), good)
    return good


@inner
def lane_errors(
    unit: Unit,
    system: System,
    method: Method,
    work: Work,
    phase: Phase,
    h: Lanes,
    share: float,
    good: Mask,
) -> tuple[Lanes, Lanes]:
    """Both relative errors of steps of h (s) of an adaptive method that ended in `work`, of order
    h⁶ and h⁴, in parts of `share`."""
    speed = usual_speed(system, work, phase)
    fine = _norm(unit, system, method, work, 0, h, speed, good) / share
    return fine, _norm(unit, system, method, work, 1, h, speed, good) / share


@inner
def _norm(
    unit: Unit,
    system: System,
    method: Method,
    work: Work,
    which: int,
    h: Lanes,
    speed: Lanes,
    good: Mask,
) -> Lanes:
    """Embedded error `which`."""
    displacement_error(unit, system, method, work, which, h)
    displacement = lane_free_part(unit, system, work, good)
    momentum_error(unit, system, method, work, which, h)
    return relative(system, displacement, lane_free_part(unit, system, work, good), speed)


@inner
def lane_free_part(unit: Unit, system: System, work: Work, where: Mask) -> Lanes:
    """`step_error.free_part`."""
    zero(work.r2)
    zero(work.y)
    zero(work.along)
    for i in range(work.p.size):
        work.delta[i] = work.p[i]
    until = Until(np.int64(3), 1e-3, 1.0)
    augmented_lanes(unit, system, work, work.p, work.along, until, where)
    return largest(work.along, work.p.size)

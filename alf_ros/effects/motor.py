"""A motor on a coordinate x of a joint, with its controller and its limits.

It drives with e(t) + k_p (x*(t) - x) + k_v (ẋ* - ẋ): an effort (no gain), a speed (k_v) or a
position (k_p, and k_v to damp), where ẋ* is the slope of x* unless given. The result stays between
-L (1 + ẋ/ẋ₀) and L (1 - ẋ/ẋ₀), L the effort at standstill and ẋ₀ the speed without load: the
line of a direct-current motor between its extreme voltages. The inertia of its rotor is no force
but mass: it joins the mechanism (`rotor`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.controlled import aimed as aimed
from alf_ros.effects.contract.controlled import follows as follows
from alf_ros.effects.contract.controlled import gain_of_position
from alf_ros.effects.contract.piecewise import Points, instants, interpolate, signal, slope
from alf_ros.effects.contract.scalars import Measures, numbers_of, push, scalar, shared
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True
HOLDS = (contract.EFFORT_OVER_TIME,)


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'coordinate', 'doc': 'joint, or one of its coordinates'})
    effort: float | Points = field(
        default=0.0,
        metadata={'kind': 'signal', 'unit': 'N m or N', 'doc': 'effort e; or a table t, e'},
    )
    position: float | Points | None = field(
        default=None,
        metadata={'kind': 'signal', 'unit': 'rad or m', 'doc': 'wanted x*; or a table t, x*'},
    )
    velocity: float | Points | None = field(
        default=None,
        metadata={
            'kind': 'signal',
            'unit': 'rad/s or m/s',
            'doc': 'wanted ẋ*, or a table t, ẋ*; the slope of position if absent',
        },
    )
    position_gain: float | None = field(
        default=None,
        metadata={
            'kind': 'number',
            'unit': 'N m/rad or N/m',
            'doc': 'k_p; 0 to follow the slope of position only',
        },
    )
    velocity_gain: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 'N m s/rad or N s/m', 'doc': 'k_v'}
    )
    limit: float | None = field(
        default=None,
        metadata={'kind': 'number', 'unit': 'N m or N', 'doc': 'L; no limit if absent'},
    )
    free_speed: float | None = field(
        default=None,
        metadata={
            'kind': 'number',
            'unit': 'rad/s or m/s',
            'doc': 'ẋ₀; if absent, the limit does not depend on speed',
        },
    )

    armature: float | None = field(
        default=None,
        metadata={
            'kind': 'number',
            'unit': 'kg m² or kg',
            'doc': 'inertia of the rotor as seen from the joint: times the gear ratio squared',
        },
    )

    def __post_init__(self) -> None:
        contract.not_negative(self, 'position_gain', 'velocity_gain', 'limit', 'armature')
        contract.positive(self, 'free_speed')
        gain_of_position(self)
        if self.velocity is not None and self.velocity_gain == 0.0:
            raise ValueError('velocity needs velocity_gain')
        if self.free_speed is not None and self.limit is None:
            raise ValueError('free_speed needs limit')


def held(name: str, what: float | Points) -> Parameters:
    """Of an effort (N m or N), or one over time, on a joint coordinate: without a controller."""
    return Parameters(joint=name, effort=what)


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: k_p, k_v, L, 1/ẋ₀, whether ẋ* is given, where the tables of x* and ẋ* begin
    after the table of e, tables. Raises ValueError for a joint without coordinate."""
    measures = Measures(layout)
    functions: list[float | Points] = []
    for effect in effects:
        p: Parameters = effect.parameters
        measures.add_coordinate(p.joint)
        limit = math.inf if p.limit is None else p.limit
        slope_of_limit = 0.0 if p.free_speed is None else 1.0 / p.free_speed
        own = [s or 0.0 for s in (p.effort, p.position, p.velocity)]
        e, x, xd = (signal(s) for s in own)
        functions += own
        given = float(p.velocity is not None)
        head = [p.position_gain or 0.0, p.velocity_gain, limit, slope_of_limit, given]
        measures.give([*head, e.size, e.size + x.size, *e, *x, *xd])
    smooth = all(effect.parameters.limit is None for effect in effects)
    return replace(measures.packed(smooth=smooth), instants=instants(*functions))


def unlimited(parameters: Parameters) -> Parameters:
    """Without limits."""
    return replace(parameters, limit=None, free_speed=None)


@shared
def _wanted(
    t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats, n: int
) -> tuple[float, float]:
    """The effort without limits, and ẋ."""
    at = numbers_of(slots, n)
    e = at + 7
    x, xd = scalar(q, qd, near, slots, params, n)
    position_table, velocity_table = e + int(params[at + 5]), e + int(params[at + 6])
    velocity = interpolate(params, velocity_table, t)
    if params[at + 4] == 0.0:  # it is 0, and has a slope all the same: a target may be added
        velocity += slope(params, position_table, t)
    effort = interpolate(params, e, t)
    effort += params[at] * (interpolate(params, position_table, t) - x)
    return effort + params[at + 1] * (velocity - xd), xd


@contract.force
def force(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    slots: Integers,
    params: Floats,
    Q: Floats,
) -> None:
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        effort, xd = _wanted(t, q, qd, near, slots, params, n)
        limit = params[at + 2]
        if limit < math.inf:
            speed = xd * params[at + 3]
            effort = min(max(effort, -limit * (1.0 + speed)), limit * (1.0 - speed))
        push(q, slots, params, n, effort, Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        place, limit = 0.0, params[at + 2]
        if limit < math.inf:
            effort, xd = _wanted(t, q, qd, near, slots, params, n)
            speed = xd * params[at + 3]
            if effort < -limit * (1.0 + speed):
                place += 7.0
            elif effort > limit * (1.0 - speed):
                place -= 7.0
        total += (n + 1.0) * place
    return total


@contract.tangent
def tangent(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    loads: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    stiff: Floats,
    G: Floats,
) -> None:
    at = numbers_of(slots, n)
    effort, xd = _wanted(t, q, qd, near, slots, params, n)
    limit, speed = params[at + 2], xd * params[at + 3]
    stiff[0] = params[at]
    stiff[1] = params[at + 1]
    if limit < math.inf:
        if effort < -limit * (1.0 + speed) or effort > limit * (1.0 - speed):
            stiff[0] = 0.0
            stiff[1] = limit * params[at + 3]
    push(q, slots, params, n, 1.0, G)

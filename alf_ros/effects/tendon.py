"""A tendon: springs, losses, stops and a drive along a length L over joints or over places.

L = Σ c x of joint coordinates, or Σ w l of the distances l of successive places: w is 1, behind a
pulley that shares the tension less, and 0 where there is no cord. The effort F = -T(L - L₀) - b L̇
- f L̇ / √(L̇² + ε²) on L, with stops and drive, gives Q = F ∂L/∂q. A stop pushes back with k δ^1.5
at a depth δ. The drive e(t) + k_p (L*(t) - L) + k_v (L̇* - L̇), L̇* the slope of L* unless given,
stays between -limit and limit. Efforts that lengthen are positive. V = ∫ T + Σ k δ^2.5 / 2.5.
The inertia of a rotor on joints is no force but mass: it joins the mechanism, as a motor has it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import sqrt

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.controlled import aimed as aimed
from alf_ros.effects.contract.controlled import follows as follows
from alf_ros.effects.contract.controlled import gain_of_position
from alf_ros.effects.contract.piecewise import (
    Points,
    instants,
    integral,
    interpolate,
    interval_of,
    law,
    side_of,
    signal,
    slope,
)
from alf_ros.effects.contract.scalars import (
    Measures,
    component,
    numbers_of,
    place,
    push,
    push_component,
    scalar,
    shared,
)
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True

STOP = 1.5  # exponent of the stops
_TABLES = 18  # where the tables begin


def _of(kind: str, unit: str, doc: str) -> dict[str, str]:
    return {'kind': kind, 'unit': unit, 'doc': doc}


def _number(unit: str, doc: str) -> dict[str, str]:
    return _of('number', unit, doc)


@dataclass(frozen=True)
class Parameters:
    joints: tuple[tuple[str, float], ...] | None = field(
        default=None,
        metadata=_of('factors', '1', 'joint coordinates x, each with its factor c; or'),
    )
    path: tuple[tuple[str, str | tuple[float, ...] | None], ...] | None = field(
        default=None,
        metadata=_of('path', 'm', 'places: points, or bodies or ground, each with a place'),
    )
    weights: tuple[float, ...] = field(
        default=(),
        metadata=_of('numbers', '1', 'w from each place to the next; 1') | {'needs': ('path',)},
    )
    stiffness: float | None = field(
        default=None, metadata=_number('N/m', 'stiffness of T; of joints per unit of L')
    )
    table: Points | None = field(
        default=None,
        metadata=_of(
            'table', 'm, N', 'instead of stiffness: extension and T, straight between and beyond'
        ),
    )
    free_length: float | None = field(
        default=None, metadata=_number('m', 'L₀, the length without T; as drawn if absent')
    )
    damping: float = field(default=0.0, metadata=_number('N s/m', 'damping b'))
    friction: float = field(default=0.0, metadata=_number('N', 'dry friction f'))
    slip: float = field(
        default=1e-2,
        metadata=_number('m/s', 'speed ε below which dry friction fades')
        | {'needs': ('friction',)},
    )
    lower: float | None = field(default=None, metadata=_number('m', 'lower stop of L'))
    upper: float | None = field(default=None, metadata=_number('m', 'upper stop of L'))
    stop_stiffness: float | None = field(
        default=None,
        metadata=_number('N/m^1.5', 'stiffness k of the stops') | {'needs': ('lower', 'upper')},
    )
    effort: float | Points = field(
        default=0.0, metadata=_of('signal', 'N', 'effort e; or a table t, e')
    )
    position: float | Points | None = field(
        default=None, metadata=_of('signal', 'm', 'wanted L*; or a table t, L*')
    )
    velocity: float | Points | None = field(
        default=None,
        metadata=_of(
            'signal', 'm/s', 'wanted L̇*, or a table t, L̇*; the slope of position if absent'
        ),
    )
    position_gain: float | None = field(
        default=None, metadata=_number('N/m', 'k_p; 0 to follow the slope of position only')
    )
    velocity_gain: float = field(default=0.0, metadata=_number('N s/m', 'k_v'))
    limit: float | None = field(
        default=None, metadata=_number('N', 'largest effort of the drive; no limit if absent')
    )
    armature: float | None = field(
        default=None,
        metadata=_number('kg', 'inertia a of a rotor that turns with L: ½ a L̇²')
        | {'needs': ('joints',)},
    )

    def __post_init__(self) -> None:
        contract.either(self, 'joints', 'path')
        if len(dict(self.joints or ())) < len(self.joints or ()):
            raise ValueError('a joint coordinate has one factor')
        gains = ('stiffness', 'damping', 'friction', 'stop_stiffness')
        drive = ('position_gain', 'velocity_gain', 'limit', 'armature')
        contract.not_negative(self, *gains, *drive)
        contract.positive(self, 'slip')
        if self.path is not None and len(self.path) < 2:
            raise ValueError('a path has two places at least')
        if self.weights and len(self.weights) != len(self.path or ()) - 1:
            raise ValueError('weights are one less than the places of the path')
        path = self.path or ()
        ways = zip(self.factors, path, path[1:], strict=False)
        if any(w != 0.0 and here == there for w, here, there in ways):
            raise ValueError('two places of a path, one after the other, are the same')
        if not any(w != 0.0 for w in self.factors):
            raise ValueError('it has no length: all factors or weights are zero')
        if self.stiffness is not None and self.table is not None:
            raise ValueError('give one of stiffness, table')
        if self.free_length is not None and self.stiffness is None and self.table is None:
            raise ValueError('free_length needs stiffness or table')
        if (self.lower, self.upper) != (None, None) and self.stop_stiffness is None:
            raise ValueError('lower and upper need stop_stiffness')
        if None not in (self.lower, self.upper) and not self.lower < self.upper:  # type: ignore[operator]
            raise ValueError('the lower stop must be below the upper one')
        gain_of_position(self)
        if self.velocity is not None and self.velocity_gain == 0.0:
            raise ValueError('velocity needs velocity_gain')

    @property
    def factors(self) -> tuple[float, ...]:
        """Of each joint coordinate, or of each distance."""
        if self.joints is not None:
            return tuple(factor for _, factor in self.joints)
        return self.weights or (1.0,) * (len(self.path or ()) - 1)

    @property
    def has_kinks(self) -> bool:
        """Whether the effort has kinks at lengths."""
        return self.table is not None or self.lower is not None or self.upper is not None


@dataclass(frozen=True)
class OnOneJoint(Parameters):
    """The part of a tendon that pushes the joint coordinate `pushed` alone."""

    pushed: str = field(default='', metadata={'kind': 'coordinate', 'doc': 'what it pushes'})


def on_axis(parameters: Parameters, coordinate: str) -> OnOneJoint:
    """Of a tendon over joints: its part on one of them."""
    return OnOneJoint(**vars(parameters), pushed=coordinate)


def unlimited(parameters: Parameters) -> Parameters:
    """Without limit of its drive."""
    return replace(parameters, limit=None)


def creeping(p: Parameters) -> float | None:
    """ε."""
    return p.slip if p.friction else None


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """One scalar for each joint or distance; the first of a tendon has its numbers.

    Numbers of each scalar: how many the tendon has (0 if it is not the first), its factor in L,
    its factor where F pushes. Of the first also: directions, L₀, b, f, ε, lower, upper, k, k_p,
    k_v, limit, whether L̇* is given, where the tables of e, L* and L̇* begin, and the tables of
    T, e, L* and L̇*.

    Raises ValueError for joints without coordinate and places that are none.
    """
    measures, shapes = Measures(layout), []
    for effect in effects:
        p: Parameters = effect.parameters
        parts = [n for n, w in enumerate(p.factors) if w != 0.0]
        shapes.append((len(parts), p.path is not None))
        for n in parts:
            _add(measures, layout, p, n)
            is_pushed = not isinstance(p, OnOneJoint) or p.pushed == (p.joints or ())[n][0]
            head = [p.factors[n], p.factors[n] * is_pushed]
            if n == parts[0]:
                measures.give([len(parts), *head, *_numbers(p, parts, layout)])
            else:
                measures.give([0.0, *head])
    packed = measures.packed()
    moved = iter(packed.directions)  # the blocks of each scalar
    directions: list[tuple[int, ...]] = []
    for count, is_path in shapes:
        own = [next(moved) for _ in range(count)]
        directions.append(tuple(sorted({block for each in own for block in each})))
        directions += [each for each in own for _ in range(layout.dimension) if is_path]
    known = len(shapes) if any(each.parameters.has_kinks for each in effects) else 0
    given = [each.parameters for each in effects]
    times = instants(*(s or 0.0 for p in given for s in (p.effort, p.position, p.velocity)))
    return replace(packed, directions=tuple(directions), intervals=known, instants=times)


def _add(measures: Measures, layout: Layout, p: Parameters, n: int) -> None:
    """The n-th joint or distance."""
    if p.joints is not None:
        measures.add_coordinate(p.joints[n][0])
    else:
        measures.add_distance(*(place(layout, *each) for each in (p.path or ())[n : n + 2]))


def _numbers(p: Parameters, parts: Sequence[int], layout: Layout) -> list[float]:
    drawn, free = Measures(layout), p.free_length
    if free is None:
        free = 0.0
        for n in parts:
            _add(drawn, layout, p, n)
            free += p.factors[n] * drawn.drawn()
    directions = 1 if p.path is None else 1 + layout.dimension * len(parts)
    lower = -math.inf if p.lower is None else p.lower
    upper = math.inf if p.upper is None else p.upper
    limit = math.inf if p.limit is None else p.limit
    stops = [lower, upper, p.stop_stiffness or 0.0]
    drive = [p.position_gain or 0.0, p.velocity_gain, limit, float(p.velocity is not None)]
    T = law(p.stiffness, p.table)
    e, L, Ld = (signal(each or 0.0) for each in (p.effort, p.position, p.velocity))
    starts = np.cumsum([_TABLES + T.size, e.size, L.size])
    head = [directions, free, p.damping, p.friction, p.slip, *stops, *drive, *starts]
    return [*head, *T, *e, *L, *Ld]


# ------------------------------------------------------------------------------------- compiled


@shared
def _length(
    q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats, n: int
) -> tuple[float, float]:
    """L and L̇ of the tendon whose first scalar is n."""
    L, rate = 0.0, 0.0
    for m in range(n, n + int(params[numbers_of(slots, n)])):
        x, xd = scalar(q, qd, near, slots, params, m)
        w = params[numbers_of(slots, m) + 1]
        L += w * x
        rate += w * xd
    return L, rate


@shared
def _push(q: Floats, slots: Integers, params: Floats, n: int, F: float, Q: Floats) -> None:
    """Q += F ∂L/∂q."""
    for m in range(n, n + int(params[numbers_of(slots, n)])):
        push(q, slots, params, m, F * params[numbers_of(slots, m) + 2], Q)


@shared
def _depth(params: Floats, at: int, L: float) -> float:
    """Of L behind a stop: below the lower one negative, between them zero."""
    if L < params[at + 8]:
        return L - params[at + 8]
    if L > params[at + 9]:
        return L - params[at + 9]
    return 0.0 * L


@shared
def _drive(t: float, params: Floats, at: int, L: float, rate: float) -> float:
    """The effort of the drive without limits."""
    e, position = at + int(params[at + 15]), at + int(params[at + 16])
    speed = interpolate(params, at + int(params[at + 17]), t)
    if params[at + 14] == 0.0:  # it is 0, and has a slope all the same: a target may be added
        speed += slope(params, position, t)
    effort = interpolate(params, e, t)
    effort += params[at + 11] * (interpolate(params, position, t) - L)
    return effort + params[at + 12] * (speed - rate)


@shared
def _effort(t: float, params: Floats, at: int, L: float, rate: float) -> float:
    """F."""
    limit = params[at + 13]
    F = min(max(_drive(t, params, at, L, rate), -limit), limit)
    F -= interpolate(params, at + _TABLES, L - params[at + 4]) + params[at + 5] * rate
    F -= params[at + 6] * rate / sqrt(rate * rate + params[at + 7] * params[at + 7])
    depth = _depth(params, at, L)
    if depth < 0.0:
        F += params[at + 10] * (-depth) ** STOP
    elif depth > 0.0:
        F -= params[at + 10] * depth**STOP
    return F


@contract.force
def force(
    t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats, Q: Floats
) -> None:
    n = 0
    while n < slots[1]:
        at = numbers_of(slots, n)
        L, rate = _length(q, qd, near, slots, params, n)
        _push(q, slots, params, n, _effort(t, params, at, L, rate), Q)
        n += int(params[at])


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total, n = 0.0, 0
    while n < slots[1]:
        at = numbers_of(slots, n)
        L, rate = _length(q, qd, near, slots, params, n)
        here = side_of(params, at + _TABLES, L - params[at + 4])
        depth, limit = _depth(params, at, L), params[at + 13]
        effort = _drive(t, params, at, L, rate)
        here += 11.0 * ((depth > 0.0) - (depth < 0.0))
        here += 13.0 * ((effort > limit) - (effort < -limit))
        total += (n + 1.0) * here
        n += int(params[at])
    return total


@contract.interval
def interval(
    t: float,
    q: Floats,
    qd: Floats,
    near: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    out: Floats,
) -> None:
    """The length."""
    first = 0
    for _ in range(n):
        first += int(params[numbers_of(slots, first)])
    at = numbers_of(slots, first)
    L, out[1] = _length(q, qd, near, slots, params, first)
    low, high = interval_of(params, at + _TABLES, L - params[at + 4])
    low += params[at + 4]
    high += params[at + 4]
    depth = _depth(params, at, L)
    if depth < 0.0:
        high = min(high, params[at + 8])
    elif depth > 0.0:
        low = max(low, params[at + 9])
    else:
        low, high = max(low, params[at + 8]), min(high, params[at + 9])
    out[0], out[2], out[3] = L, low, high


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy, n = 0.0, 0
    while n < slots[1]:
        at = numbers_of(slots, n)
        L, _ = _length(q, q, near, slots, params, n)
        energy += integral(params, at + _TABLES, L - params[at + 4])
        energy -= integral(params, at + _TABLES, 0.0)
        depth = abs(_depth(params, at, L))
        energy += params[at + 10] * depth ** (STOP + 1.0) / (STOP + 1.0)
        n += int(params[at])
    return energy


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
    """-∂F/∂L along it; and of a path T w/l across each distance, as tension holds it straight."""
    D, first = slots[0], 0
    while n >= int(params[numbers_of(slots, first) + 3]):
        n -= int(params[numbers_of(slots, first) + 3])
        first += int(params[numbers_of(slots, first)])
    at = numbers_of(slots, first)
    L, rate = _length(q, qd, near, slots, params, first)
    depth, s = abs(_depth(params, at, L)), sqrt(rate * rate + params[at + 7] * params[at + 7])
    if n == 0:
        stiff[0] = slope(params, at + _TABLES, L - params[at + 4])
        stiff[0] += STOP * params[at + 10] * sqrt(depth)
        stiff[1] = params[at + 5] + params[at + 6] * params[at + 7] * params[at + 7] / (s * s * s)
        if abs(_drive(t, params, at, L, rate)) <= params[at + 13]:
            stiff[0] += params[at + 11]
            stiff[1] += params[at + 12]
        _push(q, slots, params, first, 1.0, G)
        return
    m, a = first + (n - 1) // D, (n - 1) % D
    T = -params[numbers_of(slots, m) + 1] * _effort(t, params, at, L, rate)
    length, _ = scalar(q, qd, near, slots, params, m)
    stiff[0] = max(0.0, T / length) if length > 0.0 else 0.0
    stiff[1] = 0.0
    if length > 0.0:
        u, _ = component(q, qd, slots, params, m, a)
        for b in range(D):
            v, _ = component(q, qd, slots, params, m, b)
            across = (a == b) - u * v / (length * length)
            push_component(q, slots, params, m, b, across, G)

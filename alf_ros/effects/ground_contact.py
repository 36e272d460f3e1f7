"""Contact of a point, of a circle in the plane, or of a ball or wheel in space, with a plane that
is fixed.

At a depth δ (m) the plane pushes with N = k δᵖ (1 + c δ̇), never pulls (Hunt & Crossley, see
`joint_stop`), and rubs with -μ N v / √(v² + ε²), v the velocity along the plane of the point that
touches, at r = -R n from the centre. A circle therefore slips, rolls or spins. V = k δᵖ⁺¹ / (p +
1). Below ε friction is a steep viscous one: a body at rest on a slope creeps with ε tan α / √(μ² -
tan² α).

A wheel is a circle in space about an axle a. It touches with its lowest point,

    r = -R (n - c a) / s,   c = κ n · a,   s = √(1 - c n · a)

so that δ has R s in the place of R. κ = 1 but for a millionth: within 1e-3 rad of lying on its
face it does not rock from one side of its rim to the other at once. It has no width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, sqrt

import numpy as np

from alf_ros import columns
from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.scalars import (
    Measures,
    component,
    component_value,
    numbers_of,
    place,
    push_component,
    shared,
)
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True
_ROUND = 1.0 - 1e-6  # κ


@dataclass(frozen=True)
class Parameters:
    on: str = field(metadata={'kind': 'body or point', 'doc': 'what touches'})
    stiffness: float = field(metadata={'kind': 'number', 'unit': 'N/m^p', 'doc': 'stiffness k'})
    at: str | tuple[float, ...] | None = field(
        default=None,
        metadata={
            'kind': 'place',
            'unit': 'm',
            'doc': 'point or centre: a point of the body, or a place in its frame; its centre of '
            'mass if absent',
        },
    )
    radius: float = field(
        default=0.0,
        metadata={
            'kind': 'number',
            'unit': 'm',
            'doc': 'R of the circle, ball or wheel; 0: a point',
        },
    )
    axle: tuple[float, ...] = field(
        default=(),
        metadata={
            'kind': 'vector',
            'doc': 'of a wheel in space, in the frame of its body; a ball if absent',
            'needs': ('radius',),
        },
    )
    through: tuple[float, ...] = field(
        default=(),
        metadata={
            'kind': 'vector',
            'unit': 'm',
            'doc': 'place on the plane; the origin if absent',
        },
    )
    normal: tuple[float, ...] = field(
        default=(),
        metadata={
            'kind': 'vector',
            'doc': 'n, to the free side, of any length; y in the plane, z in space if absent',
        },
    )
    exponent: float = field(
        default=1.5, metadata={'kind': 'number', 'unit': '1', 'doc': 'exponent p, at least 1'}
    )
    damping: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 's/m', 'doc': 'losses c'}
    )
    friction: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': '1', 'doc': 'coefficient μ'}
    )
    slip: float = field(
        default=1e-2,
        metadata={
            'kind': 'number',
            'unit': 'm/s',
            'doc': 'speed ε below which friction fades',
            'needs': ('friction',),
        },
    )

    def __post_init__(self) -> None:
        contract.not_negative(self, 'stiffness', 'radius', 'damping', 'friction')
        contract.positive(self, 'slip')
        if self.exponent < 1.0:
            raise ValueError('exponent must be 1 at least')
        for name in ('normal', 'axle'):
            if getattr(self, name) and not any(getattr(self, name)):
                raise ValueError(f'{name} has no direction')
        if self.axle and not self.radius:
            raise ValueError('axle: a wheel has a radius greater than zero')


def at_rest(_: Parameters) -> str:
    """A contact."""
    return contract.CONTACT


def creeping(p: Parameters) -> float | None:
    """ε."""
    return p.slip if p.friction else None


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: k, p, c, μ, ε, R, number of directions of the body, n · through, n; 1 for a
    wheel, and a.

    Raises ValueError for a place that is none, and for a wheel that cannot be. What does not turn
    is pushed at its centre.
    """
    measures = Measures(layout)
    D = layout.dimension
    for effect in effects:
        p: Parameters = effect.parameters
        if p.axle and not (D == 3 and layout.turns(p.on)):
            raise ValueError('axle: only a body in space that turns has one')
        round_one = p.radius > 0.0 and layout.turns(p.on)
        arms = [layout.direction(p.on, tuple(e)) for e in np.eye(D)] if round_one else []
        measures.add_place(place(layout, p.on, p.at), arms)
        normal = np.array(p.normal or (0.0,) * (D - 1) + (1.0,))
        normal = normal / columns.norm(normal)
        height = columns.dot(normal, columns.array(p.through or np.zeros(D)))
        law = [p.stiffness, p.exponent, p.damping, p.friction, p.slip, p.radius]
        axle = np.array(p.axle) / columns.norm(np.array(p.axle)) if p.axle else np.zeros(D)
        measures.give([*law, len(arms), height, *normal, float(bool(p.axle)), *axle])
    return measures.packed(directions=D, intervals=True)


@shared
def _tilt(
    q: Floats, qd: Floats, slots: Integers, params: Floats, n: int, at: int
) -> tuple[float, float, float]:
    """c and 1 / s of a wheel, and ṡ; of a ball 0, 1 and 0."""
    D = slots[0]
    c, inverse, fall = 0.0, 1.0, 0.0
    if params[at + 8 + D] != 0.0:
        turning = 0.0
        for k in range(D):
            for b in range(D):
                u, ud = component(q, qd, slots, params, n, D * (k + 1) + b)
                weight = params[at + 9 + D + k] * params[at + 8 + b]
                c += weight * u
                turning += weight * ud
        upright = c
        c *= _ROUND
        # In a stage that is not yet projected the axle can be longer than 1.
        inverse = 1.0 / sqrt(max(1.0 - _ROUND, 1.0 - c * upright))
        fall = -c * turning * inverse
    return c, inverse, fall


@shared
def _arm(
    q: Floats, slots: Integers, params: Floats, n: int, at: int, k: int, c: float, inverse: float
) -> float:
    """r · u_k, u_k the k-th axis of the body; c and 1 / s as `_tilt`."""
    D, arm = slots[0], c * params[at + 9 + slots[0] + k]
    for b in range(D):
        u = component_value(q, slots, params, n, D * (k + 1) + b)
        arm -= params[at + 8 + b] * u
    return params[at + 5] * inverse * arm


@shared
def _arms(
    q: Floats, slots: Integers, params: Floats, n: int, at: int, c: float, inverse: float
) -> tuple[float, float, float]:
    """r in the frame of the body; 0 of what does not turn."""
    x = y = z = 0.0
    if params[at + 6] != 0.0:
        x = _arm(q, slots, params, n, at, 0, c, inverse)
        y = _arm(q, slots, params, n, at, 1, c, inverse)
        if slots[0] == 3:
            z = _arm(q, slots, params, n, at, 2, c, inverse)
    return x, y, z


@shared
def _part(a: int, x: float, y: float, z: float) -> float:
    """Component a."""
    return x if a == 0 else y if a == 1 else z


@shared
def _slip(
    q: Floats,
    qd: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    at: int,
    sinking: float,
    rx: float,
    ry: float,
    rz: float,
) -> tuple[float, float, float]:
    """v: of the centre, along the plane, and ω × r = Σ (r · u_k) u̇_k."""
    D, x, y, z = slots[0], 0.0, 0.0, 0.0
    for a in range(D):
        _, slip = component(q, qd, slots, params, n, a)
        slip += sinking * params[at + 8 + a]
        for k in range(int(params[at + 6])):
            _, ud = component(q, qd, slots, params, n, D * (k + 1) + a)
            slip += _part(k, rx, ry, rz) * ud
        if a == 0:
            x = slip
        elif a == 1:
            y = slip
        else:
            z = slip
    return x, y, z


@shared
def _along(
    slots: Integers, params: Floats, at: int, speed: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """The direction of v; from rest, one along the plane."""
    D = slots[0]
    if speed > 0.0:
        return x / speed, y / speed, z / speed
    flat = 0
    for b in range(1, D):
        if abs(params[at + 8 + b]) < abs(params[at + 8 + flat]):
            flat = b
    of = params[at + 8 + flat]
    size = sqrt(1.0 - of * of)
    third = 0.0
    if D == 3:
        third = ((flat == 2) - params[at + 10] * of) / size
    return (
        ((flat == 0) - params[at + 8] * of) / size,
        ((flat == 1) - params[at + 9] * of) / size,
        third,
    )


@shared
def _sunk(
    q: Floats, qd: Floats, slots: Integers, params: Floats, n: int, at: int
) -> tuple[float, float, float, float]:
    """δ and δ̇; c and 1 / s as `_tilt`."""
    c, inverse, fall = _tilt(q, qd, slots, params, n, at)
    depth, sinking = params[at + 5] / inverse + params[at + 7], params[at + 5] * fall
    for a in range(slots[0]):
        r, v = component(q, qd, slots, params, n, a)
        depth -= params[at + 8 + a] * r
        sinking -= params[at + 8 + a] * v
    return depth, sinking, c, inverse


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
    D = slots[0]
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        normal, arms = at + 8, int(params[at + 6])
        depth, sinking, c, inverse = _sunk(q, qd, slots, params, n, at)
        if depth <= 0.0:
            continue
        N = params[at] * depth ** params[at + 1] * max(0.0, 1.0 + params[at + 2] * sinking)
        rx, ry, rz = _arms(q, slots, params, n, at, c, inverse)
        vx, vy, vz = _slip(q, qd, slots, params, n, at, sinking, rx, ry, rz)
        square = params[at + 4] * params[at + 4] + vx * vx + vy * vy + vz * vz
        rub = params[at + 3] * N / sqrt(square)
        for a in range(D):
            F = -rub * _part(a, vx, vy, vz)
            push_component(q, slots, params, n, a, N * params[normal + a] + F, Q)
            if params[normal + D] != 0.0:  # under a ball N has no lever
                F += N * params[normal + a]
            for k in range(arms):
                lever = F * _part(k, rx, ry, rz)
                push_component(q, slots, params, n, D * (k + 1) + a, lever, Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        depth, sinking, _, _ = _sunk(q, qd, slots, params, n, at)
        if depth > 0.0 and params[at + 2] * sinking > -1.0:
            total += n + 1.0
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
    """The height above the plane."""
    at = numbers_of(slots, n)
    depth, sinking, _, _ = _sunk(q, qd, slots, params, n, at)
    height = -depth
    out[0], out[1] = height, -sinking
    out[2], out[3] = (-inf, 0.0) if height < 0.0 else (0.0, inf)
    if params[at] == 0.0:  # no force, no kink
        out[2], out[3] = -inf, inf


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        depth, _, _, _ = _sunk(q, q, slots, params, n, at)
        exponent = params[at + 1] + 1.0
        energy += params[at] * max(0.0, depth) ** exponent / exponent
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
    """Along the normal; along the slip, and in space across it."""
    D = slots[0]
    m, a = n // D, n % D
    at = numbers_of(slots, m)
    normal, arms = at + 8, int(params[at + 6])
    depth, sinking, c, inverse = _sunk(q, qd, slots, params, m, at)
    stiff[0] = 0.0
    stiff[1] = 0.0
    losses = 1.0 + params[at + 2] * sinking
    if depth <= 0.0 or losses <= 0.0:
        return
    N = params[at] * depth ** params[at + 1] * losses
    rx, ry, rz = _arms(q, slots, params, m, at, c, inverse)
    if a == 0:
        stiff[0] = params[at + 1] * N / depth
        stiff[1] = params[at + 2] * N / losses
        for b in range(D):
            push_component(q, slots, params, m, b, params[normal + b], G)
            if params[normal + D] != 0.0:
                for k in range(arms):
                    lever = params[normal + b] * _part(k, rx, ry, rz)
                    push_component(q, slots, params, m, D * (k + 1) + b, lever, G)
        return
    vx, vy, vz = _slip(q, qd, slots, params, m, at, sinking, rx, ry, rz)
    square = vx * vx + vy * vy + vz * vz
    fade = params[at + 4] * params[at + 4]
    stiff[1] = params[at + 3] * N / sqrt(square + fade)
    if a == 1:
        stiff[1] *= fade / (square + fade)
    ax, ay, az = _along(slots, params, at, sqrt(square), vx, vy, vz)
    for b in range(D):
        along = _part(b, ax, ay, az)
        if a == 2:
            e, d = (b + 1) % 3, (b + 2) % 3
            along = params[normal + e] * _part(d, ax, ay, az)
            along -= params[normal + d] * _part(e, ax, ay, az)
        push_component(q, slots, params, m, b, along, G)
        for k in range(arms):
            lever = along * _part(k, rx, ry, rz)
            push_component(q, slots, params, m, D * (k + 1) + b, lever, G)

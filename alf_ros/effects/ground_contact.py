"""Contact of a point, of a circle in the plane, or of a ball in space, with a plane that is fixed.

At a depth δ (m) the plane pushes with N = k δᵖ (1 + c δ̇), never pulls (Hunt & Crossley, see
`joint_stop`), and rubs with -μ N v / √(v² + ε²), v the velocity along the plane of the point that
touches, at r = -R n from the centre. A circle therefore slips, rolls or spins. V = k δᵖ⁺¹ / (p +
1). Below ε friction is a steep viscous one: a body at rest on a slope creeps with ε tan α / √(μ² -
tan² α).
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
    numbers_of,
    place,
    push_component,
    shared,
)
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True


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
        metadata={'kind': 'number', 'unit': 'm', 'doc': 'R of the circle or ball; 0: a point'},
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
            raise ValueError(f'exponent must be 1 at least, it is {self.exponent:g}')
        if self.normal and not any(self.normal):
            raise ValueError('normal has no direction')


def at_rest(_: Parameters) -> str:
    """A contact."""
    return contract.CONTACT


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: k, p, c, μ, ε, R, number of directions of the body, n · through, n.

    Raises ValueError for a place that is none. What does not turn is pushed at its centre.
    """
    measures = Measures(layout)
    D = layout.dimension
    for effect in effects:
        p: Parameters = effect.parameters
        round_one = p.radius > 0.0 and layout.turns(p.on)
        arms = [layout.direction(p.on, tuple(e)) for e in np.eye(D)] if round_one else []
        measures.add_place(place(layout, p.on, p.at), arms)
        normal = np.array(p.normal or (0.0,) * (D - 1) + (1.0,))
        normal = normal / columns.norm(normal)
        height = columns.dot(normal, columns.array(p.through or np.zeros(D)))
        law = [p.stiffness, p.exponent, p.damping, p.friction, p.slip, p.radius]
        measures.give([*law, len(arms), height, *normal])
    return measures.packed(directions=D, intervals=True)


@shared
def _arm(q: Floats, slots: Integers, params: Floats, n: int, at: int, k: int) -> float:
    """r · u_k, r = -R n, u_k the k-th axis of the body."""
    D, arm = slots[0], 0.0
    for b in range(D):
        u, _ = component(q, q, slots, params, n, D * (k + 1) + b)
        arm -= params[at + 5] * params[at + 8 + b] * u
    return arm


@shared
def _slip(
    q: Floats,
    qd: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    at: int,
    a: int,
    sinking: float,
) -> float:
    """Component a of v: of the centre, along the plane, and ω × r = Σ (r · u_k) u̇_k."""
    D = slots[0]
    _, slip = component(q, qd, slots, params, n, a)
    slip += sinking * params[at + 8 + a]
    for k in range(int(params[at + 6])):
        _, ud = component(q, qd, slots, params, n, D * (k + 1) + a)
        slip += _arm(q, slots, params, n, at, k) * ud
    return slip


@shared
def _along(
    q: Floats,
    qd: Floats,
    slots: Integers,
    params: Floats,
    n: int,
    at: int,
    a: int,
    sinking: float,
    speed: float,
) -> float:
    """Component a of the direction of v; from rest, of one along the plane."""
    if speed > 0.0:
        return _slip(q, qd, slots, params, n, at, a, sinking) / speed
    flat = 0
    for b in range(1, slots[0]):
        if abs(params[at + 8 + b]) < abs(params[at + 8 + flat]):
            flat = b
    size = sqrt(1.0 - params[at + 8 + flat] * params[at + 8 + flat])
    return ((a == flat) - params[at + 8 + a] * params[at + 8 + flat]) / size


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
        depth, sinking = params[at + 5] + params[at + 7], 0.0
        for a in range(D):
            r, v = component(q, qd, slots, params, n, a)
            depth -= params[normal + a] * r
            sinking -= params[normal + a] * v
        if depth <= 0.0:
            continue
        N = params[at] * depth ** params[at + 1] * max(0.0, 1.0 + params[at + 2] * sinking)
        square = params[at + 4] * params[at + 4]
        for a in range(D):
            slip = _slip(q, qd, slots, params, n, at, a, sinking)
            square += slip * slip
        rub = params[at + 3] * N / sqrt(square)
        for a in range(D):
            F = -rub * _slip(q, qd, slots, params, n, at, a, sinking)
            push_component(q, slots, params, n, a, N * params[normal + a] + F, Q)
            for k in range(arms):
                arm = _arm(q, slots, params, n, at, k)
                push_component(q, slots, params, n, D * (k + 1) + a, F * arm, Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        at, depth, sinking = numbers_of(slots, n), 0.0, 0.0
        for a in range(slots[0]):
            r, v = component(q, qd, slots, params, n, a)
            depth -= params[at + 8 + a] * r
            sinking -= params[at + 8 + a] * v
        if depth + params[at + 5] + params[at + 7] > 0.0 and params[at + 2] * sinking > -1.0:
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
    height, rising = -params[at + 5] - params[at + 7], 0.0
    for a in range(slots[0]):
        r, v = component(q, qd, slots, params, n, a)
        height += params[at + 8 + a] * r
        rising += params[at + 8 + a] * v
    out[0], out[1] = height, rising
    out[2], out[3] = (-inf, 0.0) if height < 0.0 else (0.0, inf)
    if params[at] == 0.0:  # no force, no kink
        out[2], out[3] = -inf, inf


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        depth, exponent = params[at + 5] + params[at + 7], params[at + 1] + 1.0
        for a in range(slots[0]):
            r, _ = component(q, q, slots, params, n, a)
            depth -= params[at + 8 + a] * r
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
    depth, sinking = params[at + 5] + params[at + 7], 0.0
    for b in range(D):
        r, v = component(q, qd, slots, params, m, b)
        depth -= params[normal + b] * r
        sinking -= params[normal + b] * v
    stiff[0] = 0.0
    stiff[1] = 0.0
    losses = 1.0 + params[at + 2] * sinking
    if depth <= 0.0 or losses <= 0.0:
        return
    N = params[at] * depth ** params[at + 1] * losses
    if a == 0:
        stiff[0] = params[at + 1] * N / depth
        stiff[1] = params[at + 2] * N / losses
        for b in range(D):
            push_component(q, slots, params, m, b, params[normal + b], G)
        return
    square = 0.0
    for b in range(D):
        slip = _slip(q, qd, slots, params, m, at, b, sinking)
        square += slip * slip
    speed, fade = sqrt(square), params[at + 4] * params[at + 4]
    stiff[1] = params[at + 3] * N / sqrt(square + fade)
    if a == 1:
        stiff[1] *= fade / (square + fade)
    for b in range(D):
        along = _along(q, qd, slots, params, m, at, b, sinking, speed)
        if a == 2:
            c, d = (b + 1) % 3, (b + 2) % 3
            along = params[normal + c] * _along(q, qd, slots, params, m, at, d, sinking, speed)
            along -= params[normal + d] * _along(q, qd, slots, params, m, at, c, sinking, speed)
        push_component(q, slots, params, m, b, along, G)
        for k in range(arms):
            arm = _arm(q, slots, params, m, at, k)
            push_component(q, slots, params, m, D * (k + 1) + b, along * arm, G)

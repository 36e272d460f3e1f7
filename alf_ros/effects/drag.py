"""Drag of a fluid, still or with wind w (m/s), on a body or point that moves with v through it.

F = -(b + c |v - w|) (v - w) at its centre of mass or another place, and on a body that turns the
torque -s ω. c = ½ ρ C_d A of turbulent flow (Newton), b = 6 π η r of a ball in laminar flow
(Stokes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.gap_vectors import push_vector, size, vector_rate
from alf_ros.effects.contract.scalars import (
    Measures,
    component,
    numbers_of,
    place,
    push_component,
)
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True
ONE_OF = ('linear', 'quadratic', 'spin')


@dataclass(frozen=True)
class Parameters:
    on: str = field(metadata={'kind': 'body or point', 'doc': 'body that drag slows down'})
    at: str | tuple[float, ...] | None = field(
        default=None,
        metadata={
            'kind': 'place',
            'unit': 'm',
            'doc': 'a point of the body, or a place in its frame; its centre of mass if absent',
            'needs': ('linear', 'quadratic'),
        },
    )
    linear: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 'N s/m', 'doc': 'laminar drag b'}
    )
    quadratic: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 'N s^2/m^2', 'doc': 'turbulent drag c'}
    )
    spin: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 'N m s/rad', 'doc': 'drag of rotation s'}
    )
    wind: tuple[float, ...] = field(
        default=(),
        metadata={
            'kind': 'vector',
            'unit': 'm/s',
            'doc': 'velocity of the fluid; none if absent',
            'needs': ('linear', 'quadratic'),
        },
    )

    def __post_init__(self) -> None:
        contract.not_negative(self, 'linear', 'quadratic', 'spin')


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: b, c, s, number of directions of the body, w.

    Raises ValueError for a place that is none, and for `spin` of what does not turn.
    """
    measures = Measures(layout)
    D = layout.dimension
    for effect in effects:
        p: Parameters = effect.parameters
        if p.spin and not layout.turns(p.on):
            raise ValueError(f'{p.on!r} has no orientation: no drag of rotation')
        arms = [layout.direction(p.on, tuple(e)) for e in np.eye(D)] if p.spin else []
        measures.add_place(place(layout, p.on, p.at), arms)
        wind = p.wind or (0.0,) * D
        measures.give([p.linear, p.quadratic, p.spin, len(arms), *wind])
    return measures.packed(directions=1 + D + D * D)


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
        x, y, z = vector_rate(qd, slots, params, n)
        x -= params[at + 4]
        y -= params[at + 5]
        if D == 3:
            z -= params[at + 6]
        factor = -(params[at] + params[at + 1] * size(x, y, z))
        push_vector(slots, params, n, factor * x, factor * y, factor * z, Q)
        for a in range(D, D + D * int(params[at + 3])):  # directions u_k: Σ |u̇_k|² = 2 ω²
            _, ud = component(q, qd, slots, params, n, a)
            push_component(q, slots, params, n, a, -0.5 * params[at + 2] * ud, Q)


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
    """b + c v in each direction, c v more along the motion; and ½ s of the axes of a body."""
    D = slots[0]
    whole = 1 + D + D * D
    m, a = n // whole, n % whole
    at = numbers_of(slots, m)
    square = 0.0
    for b in range(D):
        _, v = component(q, qd, slots, params, m, b)
        square += (v - params[at + 4 + b]) * (v - params[at + 4 + b])
    speed = sqrt(square)
    stiff[0] = 0.0
    stiff[1] = 0.0
    if a < D:
        stiff[1] = params[at] + params[at + 1] * speed
        push_component(q, slots, params, m, a, 1.0, G)
    elif a == D:
        if speed > 0.0:
            stiff[1] = params[at + 1] * speed
            for b in range(D):
                _, v = component(q, qd, slots, params, m, b)
                push_component(q, slots, params, m, b, (v - params[at + 4 + b]) / speed, G)
    elif a - 1 < D + D * int(params[at + 3]):
        stiff[1] = 0.5 * params[at + 2]
        push_component(q, slots, params, m, a - 1, 1.0, G)

"""A spring with a damper on a coordinate x of a joint: the effort -T(x - x₀) - c ẋ.

x is the angle (rad), its turns counted, or the length (m). T is stiffness times deflection, or a
table of it. Q = (-T - c ẋ) ∂x/∂q, V = ∫ T.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.piecewise import (
    Points,
    integral,
    interpolate,
    interval_of,
    law,
    side_of,
    slope,
)
from alf_ros.effects.contract.scalars import Measures, numbers_of, push, scalar
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'coordinate', 'doc': 'joint, or one of its coordinates'})
    stiffness: float | None = field(
        default=None,
        metadata={'kind': 'number', 'unit': 'N m/rad or N/m', 'doc': 'stiffness'},
    )
    table: Points | None = field(
        default=None,
        metadata={
            'kind': 'table',
            'unit': 'rad, N m or m, N',
            'doc': 'instead of stiffness: deflection and effort, straight between and beyond',
        },
    )
    free_position: float | None = field(
        default=None,
        metadata={
            'kind': 'number',
            'unit': 'rad or m',
            'doc': 'angle or length without effort; as drawn if absent',
        },
    )
    damping: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 'N m s/rad or N s/m', 'doc': 'damping'}
    )

    def __post_init__(self) -> None:
        contract.either(self, 'stiffness', 'table')
        contract.not_negative(self, 'stiffness', 'damping')


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: x₀, c, table of T. Raises ValueError for a joint without coordinate."""
    measures = Measures(layout)
    for effect in effects:
        p: Parameters = effect.parameters
        measures.add_coordinate(p.joint)
        position = measures.drawn() if p.free_position is None else p.free_position
        measures.give([position, p.damping, *law(p.stiffness, p.table)])
    tables = any(effect.parameters.table is not None for effect in effects)
    return measures.packed(intervals=tables, smooth=not tables)


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
        x, xd = scalar(q, qd, near, slots, params, n)
        effort = interpolate(params, at + 2, x - params[at]) + params[at + 1] * xd
        push(q, slots, params, n, -effort, Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        x, _ = scalar(q, qd, near, slots, params, n)
        total += (n + 1.0) * side_of(params, at + 2, x - params[at])
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
    at = numbers_of(slots, n)
    x, out[1] = scalar(q, qd, near, slots, params, n)
    out[0] = x - params[at]
    out[2], out[3] = interval_of(params, at + 2, out[0])


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        x, _ = scalar(q, q, near, slots, params, n)
        energy += integral(params, at + 2, x - params[at]) - integral(params, at + 2, 0.0)
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
    at = numbers_of(slots, n)
    x, _ = scalar(q, qd, near, slots, params, n)
    stiff[0] = slope(params, at + 2, x - params[at])
    stiff[1] = params[at + 1]
    push(q, slots, params, n, 1.0, G)

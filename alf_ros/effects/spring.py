"""A spring between two places: the tension T(l - l₀) draws them together, l their distance (m).

T (N) is stiffness times extension, or a table of it. Q = -T ∂l/∂q, V = ∫ T. Where the places
meet, the spring has no direction and no force. What damps is a `damper`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.gap_vectors import push_distance, size, vector
from alf_ros.effects.contract.piecewise import (
    Points,
    integral,
    interpolate,
    interval_of,
    law,
    side_of,
    slope,
)
from alf_ros.effects.contract.scalars import (
    Measures,
    numbers_of,
    place,
    push,
    push_component,
    scalar,
)
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    between: tuple[str, str] = field(
        metadata={'kind': 'pair', 'doc': 'two bodies or points; or ground, with a place'}
    )
    at: tuple[str | tuple[float, ...] | None, ...] = field(
        default=(None, None),
        metadata={
            'kind': 'places',
            'unit': 'm',
            'doc': 'where on each: a point of the body, a place in its frame, or ~: its centre '
            'of mass',
        },
    )
    stiffness: float | None = field(
        default=None, metadata={'kind': 'number', 'unit': 'N/m', 'doc': 'stiffness'}
    )
    table: Points | None = field(
        default=None,
        metadata={
            'kind': 'table',
            'unit': 'm, N',
            'doc': 'instead of stiffness: extension and tension, straight between and beyond',
        },
    )
    free_length: float | None = field(
        default=None,
        metadata={
            'kind': 'number',
            'unit': 'm',
            'doc': 'length without tension; as drawn if absent',
        },
    )

    def __post_init__(self) -> None:
        contract.either(self, 'stiffness', 'table')
        contract.not_negative(self, 'stiffness', 'free_length')


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: l₀, table of T. Raises ValueError for places and tables that are none."""
    measures = Measures(layout)
    for effect in effects:
        p: Parameters = effect.parameters
        start, end = (place(layout, *each) for each in zip(p.between, p.at, strict=True))
        measures.add_distance(start, end)
        length = measures.drawn() if p.free_length is None else p.free_length
        measures.give([length, *law(p.stiffness, p.table)])
    tables = any(effect.parameters.table is not None for effect in effects)
    directions = layout.dimension + 1
    return measures.packed(directions=directions, intervals=tables, smooth=not tables)


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
        x, y, z = vector(q, slots, params, n)
        length = size(x, y, z)
        tension = interpolate(params, at + 1, length - params[at])
        push_distance(slots, params, n, -tension, length, x, y, z, Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        length, _ = scalar(q, qd, near, slots, params, n)
        total += (n + 1.0) * side_of(params, at + 1, length - params[at])
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
    length, out[1] = scalar(q, qd, near, slots, params, n)
    out[0] = length - params[at]
    out[2], out[3] = interval_of(params, at + 1, out[0])


@contract.potential
def potential(t: float, q: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    energy = 0.0
    for n in range(slots[1]):
        at = numbers_of(slots, n)
        length, _ = scalar(q, q, near, slots, params, n)
        energy += integral(params, at + 1, length - params[at])
        energy -= integral(params, at + 1, 0.0)
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
    """-∂F/∂l along it; and T/l in all directions, as a tension holds it straight."""
    D = slots[0]
    m, a = n // (D + 1), n % (D + 1)
    at = numbers_of(slots, m)
    length, _ = scalar(q, qd, near, slots, params, m)
    across = 0.0
    if length > 0.0:
        across = max(0.0, interpolate(params, at + 1, length - params[at]) / length)
    if a == 0:
        stiff[0] = slope(params, at + 1, length - params[at]) - across
        stiff[1] = 0.0
        push(q, slots, params, m, 1.0, G)
    else:
        stiff[0] = across
        stiff[1] = 0.0
        push_component(q, slots, params, m, a - 1, 1.0, G)

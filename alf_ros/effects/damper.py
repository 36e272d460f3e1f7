"""A damper between two places: the force F(l̇) holds back the change of their distance l.

F (N) is damping times speed (m/s), or a table of it. Q = -F ∂l/∂q; its power is -F l̇. Where the
places meet, the damper has no direction and no force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.gap_vectors import push_distance, size, vector, vector_rate
from alf_ros.effects.contract.piecewise import Points, interpolate, law, side_of, slope
from alf_ros.effects.contract.scalars import (
    Measures,
    numbers_of,
    place,
    push,
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
    damping: float | None = field(
        default=None, metadata={'kind': 'number', 'unit': 'N s/m', 'doc': 'damping'}
    )
    table: Points | None = field(
        default=None,
        metadata={
            'kind': 'table',
            'unit': 'm/s, N',
            'doc': 'instead of damping: speed apart and force, straight between and beyond',
        },
    )

    def __post_init__(self) -> None:
        contract.either(self, 'damping', 'table')
        contract.not_negative(self, 'damping')


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: table of F. Raises ValueError for places and tables that are none."""
    measures = Measures(layout)
    for effect in effects:
        p: Parameters = effect.parameters
        start, end = (place(layout, *each) for each in zip(p.between, p.at, strict=True))
        measures.add_distance(start, end)
        measures.give(law(p.damping, p.table))
    tables = any(effect.parameters.table is not None for effect in effects)
    return measures.packed(smooth=not tables)


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
        x, y, z = vector(q, slots, params, n)
        xd, yd, zd = vector_rate(qd, slots, params, n)
        length = size(x, y, z)
        if length > 0.0:
            speed = (x * xd + y * yd + z * zd) / length
            tension = interpolate(params, numbers_of(slots, n), speed)
            push_distance(slots, params, n, -tension, length, x, y, z, Q)


@contract.side
def side(t: float, q: Floats, qd: Floats, near: Floats, slots: Integers, params: Floats) -> float:
    total = 0.0
    for n in range(slots[1]):
        _, speed = scalar(q, qd, near, slots, params, n)
        total += (n + 1.0) * side_of(params, numbers_of(slots, n), speed)
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
    _, speed = scalar(q, qd, near, slots, params, n)
    stiff[0] = 0.0
    stiff[1] = slope(params, numbers_of(slots, n), speed)
    push(q, slots, params, n, 1.0, G)

"""A force on a body or point, or an effort on a joint, given over time by a table.

Columns: t (s), then the force (2 or 3, N) and, where the body turns, the torque (1 or 3, N m), if
it has any; for a joint t and the effort. Between its rows straight lines or a cubic spline (C²,
natural ends); before the first and after the last row as there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.effects.contract.piecewise import Points, instants, interpolate, pieces
from alf_ros.effects.contract.scalars import (
    Measures,
    component,
    numbers_of,
    place,
    push,
    push_component,
    shared,
)
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    table: Points = field(
        metadata={
            'kind': 'table',
            'unit': 's, N, N m',
            'doc': 'rows t, force, torque, or t, effort; or a CSV file of them',
        }
    )
    on: str | None = field(
        default=None,
        metadata={'kind': 'body or point', 'doc': 'body or point on which a force acts'},
    )
    at: str | tuple[float, ...] | None = field(
        default=None,
        metadata={
            'kind': 'place',
            'unit': 'm',
            'doc': 'a point of the body, or a place in its frame; its centre of mass if absent',
            'needs': ('on',),
        },
    )
    frame: str = field(
        default='world',
        metadata={
            'kind': 'text',
            'choices': ('world', 'body'),
            'doc': "frame of force and torque: 'world' or 'body'",
            'needs': ('on',),
        },
    )
    joint: str | None = field(
        default=None,
        metadata={'kind': 'coordinate', 'doc': 'joint, or its coordinate, an effort acts on'},
    )
    interpolation: str = field(
        default='linear',
        metadata={
            'kind': 'text',
            'choices': ('linear', 'cubic'),
            'doc': "between rows: 'linear' or 'cubic'",
        },
    )

    def __post_init__(self) -> None:
        contract.either(self, 'on', 'joint')


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Numbers of each: number of directions of the body, whether the table is in its frame, number
    of components of the torque, size of a table, tables; a joint has no direction, and -1 in place
    of the frame.

    Raises ValueError for a wrong number of columns, and for a torque or a frame on a point.
    """
    measures = Measures(layout)
    times: list[Floats] = [np.zeros(0)]
    D = layout.dimension
    spins = 1 if D == 2 else 3
    for effect in effects:
        p: Parameters = effect.parameters
        columns = len(p.table[0]) - 1
        allowed = [1] if p.on is None else [D, D + spins]
        if columns not in allowed:
            wanted = ' or '.join(str(1 + n) for n in allowed)
            raise ValueError(f'a table of {1 + columns} columns, expected {wanted}')
        cubic = p.interpolation == 'cubic'
        tables = [pieces(p.table, 1 + n, cubic, hold=True) for n in range(columns)]
        times.append(instants(p.table, cubic=cubic))
        if p.on is None:
            measures.add_coordinate(p.joint or '')
            measures.give([0, -1, 0, 0, *tables[0]])
            continue
        turned = p.frame == 'body'
        if not layout.turns(p.on) and (columns > D or turned):
            raise ValueError(f'{p.on!r} has no orientation: no torque, and no frame of its own')
        turns = columns > D or turned
        arms = [layout.direction(p.on, tuple(e)) for e in np.eye(D)] if turns else []
        measures.add_place(place(layout, p.on, p.at), arms)
        head = [len(arms), turned, columns - D, tables[0].size]
        measures.give([*head, *np.concatenate(tables)])
    return replace(measures.packed(), instants=np.concatenate(times))


@shared
def _column(params: Floats, at: int, n: int, t: float) -> float:
    return interpolate(params, at + 4 + n * int(params[at + 3]), t)


@shared
def _vector(
    q: Floats, slots: Integers, params: Floats, n: int, at: int, first: int, a: int, t: float
) -> float:
    """Component a, in the world, of the vector in D columns from `first`."""
    if params[at + 1] == 0.0:
        return _column(params, at, first + a, t)
    D, total = slots[0], 0.0
    for k in range(D):
        u, _ = component(q, q, slots, params, n, D * (k + 1) + a)
        total += _column(params, at, first + k, t) * u
    return total


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
        if params[at + 1] < 0.0:
            push(q, slots, params, n, interpolate(params, at + 4, t), Q)
            continue
        for a in range(D):
            F = _vector(q, slots, params, n, at, 0, a, t)
            push_component(q, slots, params, n, a, F, Q)
        if params[at + 2] == 0.0:
            continue
        for k in range(D):  # ½ τ × u_k on each axis u_k of the body
            first = D * (k + 1)
            if D == 2:
                torque = 0.5 * _column(params, at, 2, t)
                x, _ = component(q, q, slots, params, n, first)
                y, _ = component(q, q, slots, params, n, first + 1)
                push_component(q, slots, params, n, first, -torque * y, Q)
                push_component(q, slots, params, n, first + 1, torque * x, Q)
                continue
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                ub, _ = component(q, q, slots, params, n, first + b)
                uc, _ = component(q, q, slots, params, n, first + c)
                cross = _vector(q, slots, params, n, at, 3, b, t) * uc
                cross -= _vector(q, slots, params, n, at, 3, c, t) * ub
                push_component(q, slots, params, n, first + a, 0.5 * cross, Q)

"""A constant force F (N) and torque τ (N m) on a body, or a force on a point.

At r = (1 - a) P_i + a P_j + b J (P_j - P_i) the force gives Q_i = ((1 - a) I + b J) F and
Q_j = (a I - b J) F; the torque, from its power τ ω with d = P_j - P_i, gives Q_j = -Q_i = τ J d /
|d|². In the body's frame F turns with d. Wrenches that come from outside while a scene runs, and
the efforts of joints, are packed by this file too: they differ only in who changes their numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from alf_ros.arrays import Floats, Integers
from alf_ros.effects import contract
from alf_ros.layout import Layout

MULTIPLE = True


@dataclass(frozen=True)
class Parameters:
    on: str = field(metadata={'kind': 'body or point', 'doc': 'what it acts on'})
    force: tuple[float, ...] = field(
        default=(0.0, 0.0), metadata={'kind': 'vector', 'unit': 'N', 'doc': 'force'}
    )
    torque: float = field(
        default=0.0, metadata={'kind': 'number', 'unit': 'N m', 'doc': 'torque about +z'}
    )
    at: str | None = field(
        default=None,
        metadata={
            'kind': 'point',
            'doc': 'point of the body where the force acts; its centre of mass if absent',
        },
    )
    frame: str = field(
        default='world', metadata={'kind': 'text', 'doc': "frame of the force: 'world' or 'body'"}
    )

    def __post_init__(self) -> None:
        if self.frame not in ('world', 'body'):
            raise ValueError(f"frame must be 'world' or 'body', not {self.frame!r}")


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """slots: [count, (i, j, turns with the body) …]; params: [(a, b, F_x, F_y, τ) …].

    Raises ValueError for a torque or a body frame where there is nothing that turns, and for a
    point that is not of the body.
    """
    slots, params = [len(effects)], []
    for effect in effects:
        p: Parameters = effect.parameters
        i, j, a, b = layout.place(p.on, p.at)
        if i == j and (p.torque or p.frame == 'body'):
            raise ValueError(
                f'{p.on!r} has no orientation: no torque on it, and no frame of its own'
            )
        slots += [i, j, int(p.frame == 'body')]
        params += [a, b, *p.force, p.torque]
    return contract.Packed(np.array(slots, dtype=np.int64), np.array(params, dtype=np.float64))


@contract.force
def force(t: float, q: Floats, qd: Floats, slots: Integers, params: Floats, Q: Floats) -> None:
    for n in range(slots[0]):
        i, j, turns = 2 * slots[3 * n + 1], 2 * slots[3 * n + 2], slots[3 * n + 3]
        a, b, x, y, torque = (
            params[5 * n],
            params[5 * n + 1],
            params[5 * n + 2],
            params[5 * n + 3],
            params[5 * n + 4],
        )
        if i == j:
            Q[i] += x
            Q[i + 1] += y
        else:
            dx, dy = q[j] - q[i], q[j + 1] - q[i + 1]
            d2 = dx * dx + dy * dy
            if turns:
                d = d2**0.5
                x, y = (x * dx - y * dy) / d, (x * dy + y * dx) / d
            s = torque / d2
            Q[i] += (1.0 - a) * x - b * y + s * dy
            Q[i + 1] += (1.0 - a) * y + b * x - s * dx
            Q[j] += a * x + b * y - s * dy
            Q[j + 1] += a * y - b * x + s * dx

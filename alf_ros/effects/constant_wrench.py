"""A constant force F (N) and torque τ (N m) on a body, or a force on a point.

Both are affine in q, whether they stand still or turn with the body: see
`effects/contract/affine_force.py`.
Wrenches that come from outside while a scene runs are packed by this file too: they differ only
in who changes their numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alf_ros import columns
from alf_ros.effects import contract
from alf_ros.effects.contract import affine_force
from alf_ros.effects.contract.affine_force import Affine
from alf_ros.effects.contract.scalars import place
from alf_ros.mechanism.affine import constant
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True
ONE_OF = ('force', 'torque')
HOLDS = (contract.WRENCH,)
force = affine_force.force


@dataclass(frozen=True)
class Parameters:
    on: str = field(metadata={'kind': 'body or point', 'doc': 'body or point on which it acts'})
    force: tuple[float, ...] = field(
        default=(), metadata={'kind': 'vector', 'unit': 'N', 'doc': 'force'}
    )
    torque: float | tuple[float, ...] = field(
        default=0.0,
        metadata={'kind': 'spin', 'unit': 'N m', 'doc': 'torque, in the plane about +z'},
    )
    at: str | tuple[float, ...] | None = field(
        default=None,
        metadata={
            'kind': 'place',
            'unit': 'm',
            'doc': 'where the force acts: a point of the body, or a place in its frame; its '
            'centre of mass if absent',
            'needs': ('force',),
        },
    )
    frame: str = field(
        default='world',
        metadata={
            'kind': 'text',
            'choices': ('world', 'body'),
            'doc': "frame of force and torque: 'world' or 'body'",
        },
    )

    def __post_init__(self) -> None:
        if self.frame not in ('world', 'body'):
            raise ValueError(f"frame must be 'world' or 'body', not {self.frame!r}")


def held(name: str, what: Any) -> Parameters:
    """Of a wrench with `force`, `torque`, `at` and `frame` on a body or point."""
    return Parameters(name, what.force, what.torque, what.at, what.frame)


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Packed as Q = K q + k, see `affine`.

    Raises ValueError for a torque or a body frame where there is nothing that turns, and for a
    place that is not of the body.
    """
    Q = Affine(layout.dimension)
    for effect in effects:
        p: Parameters = effect.parameters
        torque = np.atleast_1d(columns.array(p.torque))
        if not layout.turns(p.on) and (np.any(torque) or p.frame == 'body'):
            raise ValueError(
                f'{p.on!r} has no orientation: no torque on it, and no frame of its own'
            )
        if p.force:
            turned = p.frame == 'body'
            F = layout.vector(p.on, p.force) if turned else constant(p.force)
            Q.add_force(place(layout, p.on, p.at), F)
        # alone, a torque of 0 has its place too: it has a derivative, as a force of 0 has one
        if np.any(torque) or (not p.force and layout.turns(p.on)):
            Q.add_torque(layout, p.on, torque, p.frame == 'body')
    return Q.packed()

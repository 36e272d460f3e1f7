"""A constant effort on the free axis of a joint: N m on an angle, N on a length.

It acts on the child and, the other way round, on the parent. Efforts that come from outside while
a scene runs are packed by this file too.

The axis is fixed in both bodies, so that the torque is linear in q. The axes of a universal joint
turn with one body each: a `motor` takes efforts about them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from alf_ros.effects import contract
from alf_ros.effects.contract import affine_force
from alf_ros.effects.contract.affine_force import Affine
from alf_ros.mechanism import GROUND
from alf_ros.mechanism.natural_coordinates import Layout

MULTIPLE = True
HOLDS = (contract.EFFORT,)
force = affine_force.force


@dataclass(frozen=True)
class Parameters:
    joint: str = field(metadata={'kind': 'coordinate', 'doc': 'joint, or one of its coordinates'})
    effort: float = field(
        metadata={'kind': 'number', 'unit': 'N m or N', 'doc': 'effort on the free axis'}
    )


def held(name: str, what: float) -> Parameters:
    """Of an effort (N m or N) on a joint."""
    return Parameters(name, what)


def pack(effects: Sequence[contract.Effect], layout: Layout) -> contract.Packed:
    """Packed as Q = K q + k, see `affine`.

    Raises ValueError for a joint without a single free axis, and for an axis of a universal joint.
    """
    named = layout.mechanism.coordinate
    planar = layout.dimension == 2
    Q = Affine(layout.dimension)
    for effect in effects:
        p: Parameters = effect.parameters
        if p.joint not in named:
            known = ', '.join(named)
            raise ValueError(f'{p.joint!r} has no single free axis; joint coordinates: {known}')
        if not named[p.joint].freedom.alone:
            raise ValueError(
                f'{p.joint!r} is one of the two axes of a universal joint: name the effect motor, '
                'which takes joint and effort too'
            )
        joint, is_angle = named[p.joint].joint, named[p.joint].is_angle
        axis = joint.frames[0].axes[0 if planar else 2]
        along = layout.direction(joint.parent, axis)
        for body, frame, effort in (
            (joint.child, joint.frames[1], p.effort),
            (joint.parent, joint.frames[0], -p.effort),
        ):
            if body == GROUND:
                continue
            if not is_angle:
                Q.add_force(layout.place(body, frame.origin), along.times(effort))
            elif not layout.turns(body):
                raise ValueError(f'{body!r} has no orientation: no torque on it')
            else:
                torque = np.array([1.0] if planar else frame.axes[2])
                Q.add_torque(layout, body, effort * torque, turned=not planar)
    return Q.packed()

"""Names of what moves without mass: a direction of the free motion in which nothing has mass."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import Linearised, moving

_MOST = 1500  # coordinates: beyond that dense matrices take too long
_SHOWN = 6  # names


def bodies(model: Model, q: Floats) -> list[str]:
    """Bodies that move in the first such direction at q (blocks D, m); none if there is no such
    direction, or if the mechanism is too large to find it."""
    if model.n > _MOST:
        return []
    try:
        massless = Linearised(model, q).massless
    except np.linalg.LinAlgError:
        return []
    if not massless.shape[1]:
        return []
    names = set(moving(model, massless[:, 0]))
    carried = ((body.name, {*body.points, *body.vectors}) for body in model.mechanism.bodies)
    return [name for name, own in carried if names & own]


def no_mass(model: Model, q: Floats) -> AssemblyError:
    """The error of a mechanism for which the leading matrix has no factor."""
    found = bodies(model, q)
    message = 'a point that moves has neither mass nor constraint'
    if not found:
        return AssemblyError(message, key='points')
    joints = joints_of(model, found)
    at = f', joints {listed(joints)}' if joints else ''
    return AssemblyError(
        f'a part that moves has neither mass nor constraint: bodies {listed(found)}{at}',
        key='points',
        expected='mass and inertia of these bodies, a weld in place of one of the joints, or a '
        'rotor on one (`armature` of a motor)',
    )


def joints_of(model: Model, found: list[str]) -> list[str]:
    """The joints of some bodies."""
    mine = {*found}
    return [each.name for each in model.mechanism.joints if {each.parent, each.child} & mine]


def listed(names: list[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - _SHOWN
    return ', '.join(names[:_SHOWN]) + (f' and {more} more' if more > 0 else '')

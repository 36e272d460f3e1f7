"""Names of what moves without mass: a direction of the free motion in which nothing has mass."""

from __future__ import annotations

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import AssemblyError
from alf_ros.kernel.data import EPS
from alf_ros.model.compile import Model
from alf_ros.model.dense_linearisation import MASSLESS, Linearised, moving

KEY = 'points'  # of the error
_MOST = 1500  # coordinates: beyond that dense matrices take too long
_HIDDEN = 100.0  # times ε penalty: what rounding may hide of a mass
_SHOWN = 6  # names


def bodies(model: Model, q: Floats, part: float = MASSLESS) -> list[str]:
    """Bodies that move in the free direction of least mass at q (blocks D, m), if it has less than
    this part of the mean mass; none if no direction has, or if the mechanism is too large to find
    it."""
    if model.n > _MOST:
        return []
    try:
        light = Linearised(model, q).lighter_than(part)
    except np.linalg.LinAlgError:
        return []
    if not light.shape[1]:
        return []
    names = set(moving(model, light[:, 0]))
    carried = ((body.name, {*body.points, *body.vectors}) for body in model.mechanism.bodies)
    return [name for name, own in carried if names & own]


def bodies_too_light(model: Model, q: Floats) -> list[str]:
    """The same with a mass that rounding hides: the leading matrix is rounded by about ε penalty
    of the mean mass, and may have no factor then."""
    return bodies(model, q, max(MASSLESS, _HIDDEN * EPS * model.penalty))


def no_mass(model: Model, q: Floats) -> AssemblyError:
    """The error of a mechanism for which the leading matrix has no factor."""
    found, has = bodies(model, q), 'neither mass nor constraint'
    if not found:
        found, has = bodies_too_light(model, q), 'hardly any mass and no constraint'
    if not found:
        return AssemblyError('a point that moves has neither mass nor constraint', key=KEY)
    joints = joints_of(model, found)
    at = f', joints {listed(joints)}' if joints else ''
    return AssemblyError(
        f'a part that moves has {has}: bodies {listed(found)}{at}',
        key=KEY,
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

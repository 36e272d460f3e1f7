"""Rows of velocities that have an integral: gears, racks, threads, couplings, wheels on a line.

The integral of a part *in mesh* stays constant where a body is placed: it has teeth, or is a
coupling. A wheel without teeth may be placed with another angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Mechanism
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints import couplings
from alf_ros.model.constraints.velocity_integral import IntegralTerm, slip_of
from alf_ros.model.joints import type_of
from alf_ros.model.joints.contract import Frames


class Integral(NamedTuple):
    """The integral of the row of velocities of this name.

    terms: the sum that stays constant, m. advance: m/rad, the travel per angle.
    """

    name: str
    terms: tuple[IntegralTerm, ...]
    advance: float


def has_integral(mechanism: Mechanism) -> set[str]:
    """The rows of velocities that bind positions too, by name."""
    found = {joint.name for joint in mechanism.joints if type_of(joint).integral is not None}
    found |= {rotor.name for rotor in mechanism.rotors}
    return found | {coupling.name for coupling in mechanism.couplings}


def integrals(layout: Layout, teeth: bool = False) -> tuple[Integral, ...]:
    """The integrals of joints and couplings; or, for `teeth`, of parts in mesh only."""
    found = []
    for joint in layout.mechanism.joints:
        kind = type_of(joint)
        if kind.integral is not None and (kind.teeth or not teeth):
            terms = tuple(kind.integral(Frames(joint, layout)))
            found.append(Integral(joint.name, terms, abs(joint.value)))
    for coupling in layout.mechanism.couplings:
        terms = tuple(couplings.integral(coupling, layout))
        found.append(Integral(coupling.name, terms, couplings.advance(coupling, layout)))
    return tuple(found)


def slips(found: Sequence[Integral], D: int, before: Floats, after: Floats) -> Floats:
    """(integrals,) m, by how much each changes from q to q (blocks D).

    No angle may have changed by half a turn.
    """
    places = before.reshape(-1, D), after.reshape(-1, D)
    return np.array([slip_of(each.terms, *places) for each in found])

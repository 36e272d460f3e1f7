"""Parts in mesh: by how much gears, racks, threads or couplings would slip between positions.

Their rows bind velocities. These can be integrated, so that parts stay in mesh when a body is
placed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.constraints import couplings
from alf_ros.model.joints import type_of


class Mesh(NamedTuple):
    """A part with a row of velocities of this name.

    slip: m, from q to q (blocks, D). advance: m/rad, the travel per angle.
    """

    name: str
    slip: Callable[[Layout, Floats, Floats], float]
    advance: float


def meshing(layout: Layout) -> tuple[Mesh, ...]:
    """The joints of a mechanism with teeth or a thread, and its couplings."""
    found = []
    for joint in layout.mechanism.joints:
        slip = type_of(joint).slip
        if slip is not None:
            found.append(Mesh(joint.name, partial(slip, joint), abs(joint.value)))
    for coupling in layout.mechanism.couplings:
        least = couplings.advance(coupling, layout)
        found.append(Mesh(coupling.name, partial(couplings.slip, coupling), least))
    return tuple(found)


def slips(layout: Layout, meshes: Sequence[Mesh], before: Floats, after: Floats) -> Floats:
    """(meshes,) m, by how much each slips from q to q (blocks D).

    No angle may have changed by half a turn.
    """
    D = layout.dimension
    places = before.reshape(-1, D), after.reshape(-1, D)
    return np.array([mesh.slip(layout, *places) for mesh in meshes])

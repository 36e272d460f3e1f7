"""Joints that stay in mesh: by how much gears, racks or threads would slip between two positions.

Their rows bind velocities. These can be integrated, so that what is moved by hand stays in mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.mechanism import Joint
from alf_ros.mechanism.natural_coordinates import Layout
from alf_ros.model.joints import type_of


def meshing(layout: Layout) -> tuple[Joint, ...]:
    """The joints of a mechanism with teeth or a thread."""
    return tuple(joint for joint in layout.mechanism.joints if type_of(joint).slip is not None)


def slips(layout: Layout, joints: Sequence[Joint], before: Floats, after: Floats) -> Floats:
    """(joints,) m, by how much each slips from q to q (blocks D).

    No angle may have changed by half a turn.
    """
    D = layout.dimension
    places = before.reshape(-1, D), after.reshape(-1, D)
    found = []
    for joint in joints:
        slip = type_of(joint).slip
        assert slip is not None
        found.append(slip(joint, layout, *places))
    return np.array(found)

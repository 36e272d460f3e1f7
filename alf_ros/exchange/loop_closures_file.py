"""The side file `loop_closures.yaml` of scikit-robot: hinges that close the loops of a URDF.

    closures: [{link_a: name, link_b: name, point: [x, y, z], axis: [x, y, z]}, ...]
    dependent: [joint, ...]
    independent: [joint, ...]

Points (m) and axes are in the frame of the root, with all joints at zero.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from alf_ros.exchange import two_ended_loops
from alf_ros.exchange.two_ended_loops import TwoEndedLoop
from alf_ros.exchange.urdf_import import UrdfReader
from alf_ros.scene.text import yaml_document

KEYS = ('closures', 'dependent', 'independent')
_KEYS = ('link_a', 'link_b', 'point', 'axis')


def dependent(path: Path) -> list[str]:
    """Joints that the loops move, which a <mimic> of the URDF only repeats. Raises InputError."""
    fields = yaml_document.read(path).mapping(KEYS, ('closures',))
    return (
        [each.text() for each in fields['dependent'].sequence()] if 'dependent' in fields else []
    )


def loops(path: Path, reader: UrdfReader) -> list[TwoEndedLoop]:
    """The loops of a URDF. Raises InputError."""
    found = []
    zero = reader.poses_at({})
    fields = yaml_document.read(path).mapping(KEYS, ('closures',))
    for entry in fields['closures'].sequence():
        closure = entry.mapping(_KEYS, _KEYS)
        links = [closure[key].text(reader.links) for key in ('link_a', 'link_b')]
        axis = np.array(closure['axis'].vector(3, {}))
        if not axis.any():
            raise closure['axis'].error('zero is no direction')
        place, along = np.array(closure['point'].vector(3, {})), axis / np.linalg.norm(axis)
        name = f'{links[0]}_{links[1]}'
        found.append(
            two_ended_loops.drawn(name, 'revolute', links, place, [along], zero, str(path))
        )
    return found

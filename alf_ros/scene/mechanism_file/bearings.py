"""`stiffness` of a joint: how its bearing shares a load that rigid bodies leave open."""

from __future__ import annotations

import math
from collections.abc import Mapping

from alf_ros.mechanism import Bearing
from alf_ros.scene.text.yaml_document import Entry

KEY = 'stiffness'
DOC = 'of the bearing: how it shares redundant loads'
KEYS = {
    'translation': 'N/m, against forces; rigid if absent',
    'rotation': 'N m/rad, against torques; rigid if absent',
}


# joints that transmit no torque, by the dimension of space
_FREE_TO_TURN = {2: ('revolute', 'slider'), 3: ('spherical', 'distance')}


def read(entry: Entry, names: Mapping[str, float], kind: str, dimension: int) -> Bearing:
    """The bearing of an entry of a joint of this kind; `names` are parameters. Raises
    InputError."""
    fields = entry.mapping(tuple(KEYS))
    if not fields:
        raise entry.error('nothing is stiff', choices=KEYS)
    if 'rotation' in fields and kind in _FREE_TO_TURN[dimension]:
        message = f'a {kind} joint transmits no torque that its bearing could share'
        expected = 'translation alone; a spring about a joint is the effect torsion_spring'
        raise fields['rotation'].error(message, expected=expected)
    found = dict.fromkeys(KEYS, math.inf)
    for key, each in fields.items():
        found[key] = each.number(names)
        if not found[key] > 0.0:
            raise each.error('not a stiffness', expected=f'{KEYS[key].partition(",")[0]}, > 0')
    return Bearing(found['translation'], found['rotation'])

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


def read(entry: Entry, names: Mapping[str, float]) -> Bearing:
    """The bearing of an entry; `names` are parameters. Raises InputError."""
    fields = entry.mapping(tuple(KEYS))
    if not fields:
        raise entry.error('nothing is stiff', choices=KEYS)
    found = dict.fromkeys(KEYS, math.inf)
    for key, each in fields.items():
        found[key] = each.number(names)
        if not found[key] > 0.0:
            raise each.error('not a stiffness', expected=f'{KEYS[key].partition(",")[0]}, > 0')
    return Bearing(found['translation'], found['rotation'])

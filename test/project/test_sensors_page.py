"""doc/sensors.md done as a reader does it, and its table against the kinds of sensors."""

from __future__ import annotations

import re

from alf_ros.ros.messages.sensor_messages import message_type
from alf_ros.scene.sensors_section import KINDS
from support.paths import ROOT

TEXT = (ROOT / 'doc' / 'sensors.md').read_text('utf-8')


def test_the_table_lists_every_kind_with_its_type() -> None:
    told = dict(re.findall(r'^\| `~/(\w+)/<name>` \| (\S+) \|', TEXT, re.M))
    assert told.keys() == KINDS.keys()
    for kind, name in told.items():
        package, _, short = name.partition('/msg/')
        made = message_type(kind)
        assert (made.__module__.partition('.')[0], made.__name__) == (package, short)

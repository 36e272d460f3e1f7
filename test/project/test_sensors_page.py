"""doc/sensors.md done as a reader does it, and its table against the kinds of sensors."""

from __future__ import annotations

import re
from pathlib import Path

from alf_ros.ros.messages.sensor_messages import message_type
from alf_ros.scene.sensors_section import KINDS
from support.paths import ROOT
from support.reader import programs, shown_by

TEXT = (ROOT / 'doc' / 'sensors.md').read_text('utf-8')
FILE = re.compile(r'^```yaml\n(# (\S+)\n.*?)^```', re.M | re.S)


def test_the_program_prints_what_the_page_says(tmp_path: Path) -> None:
    ((scene, file),) = FILE.findall(TEXT)
    ((program, name, shown),) = programs(TEXT)
    (tmp_path / file).write_text(scene, 'utf-8')
    (tmp_path / name).write_text(program, 'utf-8')
    assert shown_by([name], tmp_path) == (shown, '')


def test_the_table_lists_every_kind_with_its_type() -> None:
    told = dict(re.findall(r'^\| `~/(\w+)/<name>` \| (\S+) \|', TEXT, re.M))
    assert told.keys() == KINDS.keys()
    for kind, name in told.items():
        package, _, short = name.partition('/msg/')
        made = message_type(kind)
        assert (made.__module__.partition('.')[0], made.__name__) == (package, short)

"""Entries as a YAML 1.2 reader, such as an editor, reads them: the data a JSON schema judges."""

from __future__ import annotations

import re
from typing import Any

from alf_ros.scene.text.yaml_document import BOOLEAN, Entry

# The core schema of YAML 1.2.2, section 10.3.2.
INTEGER = re.compile(r'[-+]?[0-9]+')
FLOAT = re.compile(r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?')
SPECIAL = re.compile(r'[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)')


def data(entry: Entry) -> Any:
    """The value of `entry` as Python data."""
    value = entry.value
    if isinstance(value, dict):
        return {key: data(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [data(item) for item in value]
    if entry.is_null:
        return None
    if not entry.plain:
        return value
    if value in BOOLEAN:
        return BOOLEAN[value]
    if INTEGER.fullmatch(value):
        return int(value)
    if FLOAT.fullmatch(value):
        return float(value)
    if SPECIAL.fullmatch(value):
        return float(value.replace('.', ''))
    return value

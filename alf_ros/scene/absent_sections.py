"""Sections that a scene leaves out, for a value that is to be set in one of them."""

from __future__ import annotations

from collections.abc import Sequence

from alf_ros import effects
from alf_ros.scene.text.yaml_document import Entry

SECTIONS = ('mechanism', 'drives', 'effects', 'initial', 'solver')


def with_sections(root: Entry, place: Sequence[str], said: str) -> Entry:
    """The document of a scene with an empty section for a value at this place, if it has none; and
    with an empty part of it, such as the initial velocities, for a field of that part. Errors are
    about `said`."""
    section, *rest = place
    if section not in SECTIONS or not rest:
        return root
    fields = root.mapping()
    parts = fields[section].mapping() if section in fields else {}
    if len(rest) == 2 and rest[0] not in parts:
        if section == 'initial' or (section == 'effects' and rest[0] in effects.own()):
            parts[rest[0]] = Entry({}, said, path=f'{section}.{rest[0]}')
    elif section in fields:
        return root
    own = fields.get(section, Entry({}, said, path=section))
    return root.having({**fields, section: own.having(parts)})

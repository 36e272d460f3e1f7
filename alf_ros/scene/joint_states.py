"""Positions and velocities of joints, and the numbers of a scene that decide them.

A scene begins at positions and velocities of points; a joint follows from them, from a drive, or
from a motor.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from alf_ros.errors import InputError
from alf_ros.scene.text.yaml_document import Entry

_STATE = re.compile(r'(?:joints\.)?(.+)\.(position|velocity)')


def refuse_joint_state(name: str, root: Entry, said: str) -> None:
    """Raise InputError, about the argument `said`, for the position or the velocity of a joint: it
    names the drive of the joint, or the points whose positions or velocities decide it."""
    found = _STATE.fullmatch(name)
    joints = _section(root.mapping()['mechanism'].mapping(), 'joints')
    if found is None or found[1] not in joints:
        return
    joint, what = found.groups()
    driven = list(_drives(root, joint))
    part = 'positions' if what == 'position' else 'velocities'
    expected = ' or '.join(driven or [f'initial.{part}.{p}' for p in _points(root, joint)])
    raise InputError(
        f'the {what} of a joint is no number of a scene',
        key=said,
        value=name,
        expected=expected or f'initial.{part} of a point',
    )


def _drives(root: Entry, joint: str) -> Iterator[str]:
    """The names of what drives a joint."""
    fields = root.mapping()
    for owner in (fields['mechanism'].mapping(), fields):
        for name, drive in _section(owner, 'drives').items():
            if _is(drive.mapping().get('joint'), joint):
                motion = next((key for key in ('angle', 'length') if key in drive.mapping()), '')
                yield f'drives.{name}.{motion}'.rstrip('.')


def _points(root: Entry, joint: str) -> list[str]:
    """The movable points of the joint itself, or of the last of its bodies."""
    mechanism = root.mapping()['mechanism'].mapping()
    points, fields = _section(mechanism, 'points'), _section(mechanism, 'joints')[joint].mapping()
    named = [fields['point']] if 'point' in fields else []
    between = fields.get('between')
    if not named and between is not None and isinstance(between.value, tuple):
        body = _section(mechanism, 'bodies').get(str(between.value[-1].value))
        listed = body.mapping().get('points') if body is not None else None
        named = list(listed.value) if listed and isinstance(listed.value, tuple) else []
    found = [point.value for point in named if isinstance(point.value, str)]
    return [p for p in found if p in points and 'fixed' not in points[p].mapping()]


def _section(fields: Mapping[str, Entry], name: str) -> Mapping[str, Entry]:
    return fields[name].mapping() if name in fields else {}


def _is(entry: Entry | None, name: str) -> bool:
    return entry is not None and entry.value == name

"""The description in a log, checked: every value has the type that readers expect."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from alf_ros.errors import InputError

_TEXTS = ('scene', 'scene_sha256')
_WHOLE = 'a whole number'
_NAMES = 'texts by name'


def read(record: Mapping[str, str], file: str) -> dict[str, Any]:
    """The texts of a record `alf_ros` as values, the scene's text left out.

    Raises InputError for a missing value or a wrong type.
    """
    info: dict[str, Any] = {}
    for key, text in record.items():
        if key != 'scene_text':
            info[key] = text if key in _TEXTS else _value(text, key, file)
    for key, expected in _EXPECTED.items():
        if key not in info and key in _NEEDED:
            raise _damaged(file, f'{key} is missing')
        if key in info and not _is(info[key], expected):
            raise _damaged(file, f'{key} is not {expected}')
    if 'scene_text' not in record:
        raise _damaged(file, 'scene_text is missing')
    if info['steps_per_tick'] < 1:
        raise _damaged(file, 'steps_per_tick is less than 1')
    return info


def parsed(text: object) -> Any:
    """The value of a JSON text. Raises ValueError if it is none, or nested too deep to be ours."""
    if not isinstance(text, str):
        raise ValueError('no text')
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError('nested too deep') from None


_NEEDED = (*_TEXTS, 'solver', 'steps_per_tick', 'stamps_ahead_ns', 'versions')
_EXPECTED = {
    'scene': 'a text',
    'scene_sha256': 'a text',
    'solver': 'a mapping',
    'steps_per_tick': _WHOLE,
    'stamps_ahead_ns': _WHOLE,
    'versions': _NAMES,
    'topics': _NAMES,
    'effects': _NAMES,
    'state': 'a mapping',
    'parent': 'a mapping',
}


def _is(value: object, expected: str) -> bool:
    if expected == 'a text':
        return isinstance(value, str)
    if expected == _WHOLE:
        return type(value) is int and abs(value) < 2**63
    if not isinstance(value, dict):
        return False
    return expected != _NAMES or all(isinstance(each, str) for each in value.values())


def _value(text: str, key: str, file: str) -> Any:
    try:
        return parsed(text)
    except ValueError:
        raise _damaged(file, f'{key} cannot be read') from None


def _damaged(file: str, what: str) -> InputError:
    return InputError(f'its record alf_ros is damaged: {what}', file=file)

"""The journal of a log: one JSON object for each change of a motion, each sealing the entries
before.

`seal` is the start of the SHA-256 of the entry, without it, behind the seal of the entry before.
So one changed bit is found where it is, also when the motion does not show it, and so is an entry
that is missing. It protects against accidents, not against a person who computes new seals.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from typing import Any

from alf_ros.logs import record
from alf_ros.logs.series import Series

_LENGTH = 16
_LARGEST = sys.float_info.max
SEAL = 'seal'
UNREADABLE = 'unreadable'


def chained(entry: dict[str, Any], seal: str) -> tuple[str, str]:
    """The text of an entry, sealed behind the one with `seal` ('' for the first); its own seal.

    Floats are written so that they read back exactly.
    """
    own = _seal(entry, seal)
    return json.dumps({**entry, SEAL: own}), own


def read(text: object) -> dict[str, Any]:
    """An entry from its text; of the kind 'unreadable' if it is none, if its fields are not the
    fields of its kind, or if the text is not the one that `chained` writes."""
    try:
        entry = record.parsed(text)
        if isinstance(entry, dict) and is_entry(entry) and json.dumps(entry) == text:
            return entry
    except ValueError:
        pass
    return {'step': -1, 't': -1.0, 'kind': UNREADABLE, 'text': str(text), SEAL: ''}


def entries(series: Series) -> list[dict[str, Any]]:
    """The entries of the messages of a topic, whatever they are."""
    if len(series.messages) != len(series):  # of numbers
        return [read(None) for _ in range(len(series))]
    return [read(message.get('data')) for message in series.messages]


def is_entry(entry: dict[str, Any]) -> bool:
    """Whether an entry has the fields of its kind."""
    kind, step, seal = entry.get('kind'), entry.get('step'), entry.get(SEAL, '')
    if not (isinstance(kind, str) and isinstance(seal, str) and _is_time(entry.get('t'))):
        return False
    wanted = _FIELDS.get(kind, {})
    return _is_whole(step) and all(key in entry and is_(entry[key]) for key, is_ in wanted.items())


def _is_whole(value: object) -> bool:
    return type(value) is int and 0 <= value < 2**53


def _is_number(value: object) -> bool:
    """Any number that a command can hold, and no whole number beyond what a float can be."""
    return type(value) in (int, float) and abs(value) <= _LARGEST  # type: ignore[arg-type]


def _is_time(value: object) -> bool:
    """A time (s) that a stamp can tell."""
    return _is_number(value) and abs(value) < 2**63 * 1e-9  # type: ignore[arg-type]


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_mapping(value: object) -> bool:
    return isinstance(value, dict)


def _are_numbers(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_torque(value: object) -> bool:
    return _is_number(value) or _are_numbers(value)


def _is_signal(value: object) -> bool:
    """A number, or the pieces of a curve."""
    return _is_number(value) or (isinstance(value, list) and all(map(_are_numbers, value)))


def _is_signal_or_none(value: object) -> bool:
    return value is None or _is_signal(value)


def _is_number_or_none(value: object) -> bool:
    return value is None or _is_number(value)


_FIELDS: dict[str, dict[str, Callable[[object], bool]]] = {
    'wrench': {'name': _is_text, 'force': _are_numbers, 'torque': _is_torque, 'frame': _is_text},
    'effort': {'name': _is_text, 'effort': _is_signal},
    'target': {
        'name': _is_text,
        'position': _is_signal_or_none,
        'velocity': _is_number_or_none,
    },
    'settings': {'solver': _is_mapping, 'effects': _is_mapping, 'steps_per_tick': _is_whole},
}


def fault(entry: dict[str, Any], seal: str) -> str:
    """The fault of an entry behind the one with `seal`, '' without a fault. An entry without a
    seal has one."""
    if entry.get(SEAL) == _seal(entry, seal):
        return ''
    return 'changed after it was written, or one before it is missing'


def told(entry: dict[str, Any]) -> str:
    """An entry in a few words."""
    names = f' {entry["name"]}' if 'name' in entry else ''
    return f'step {entry["step"]}, {entry["kind"]}{names}'


def _seal(entry: dict[str, Any], seal: str) -> str:
    text = seal + json.dumps({key: value for key, value in entry.items() if key != SEAL})
    return hashlib.sha256(text.encode()).hexdigest()[:_LENGTH]

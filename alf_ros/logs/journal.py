"""The journal of a log: one JSON object for all that changes a motion, each sealing those before.

`seal` is the start of the SHA-256 of the entry, without it, behind the seal of the entry before.
So one changed bit is found where it is, also when the motion does not show it, and so is an entry
that is missing. It protects against accidents, not against somebody who seals anew.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

_LENGTH = 16
SEAL = 'seal'
UNREADABLE = 'unreadable'


def chained(entry: dict[str, Any], seal: str) -> tuple[str, str]:
    """The text of an entry, sealed behind the one with `seal` ('' for the first); its own seal.

    Floats are written so that they read back exactly.
    """
    own = _seal(entry, seal)
    return json.dumps({**entry, SEAL: own}), own


def read(text: str) -> dict[str, Any]:
    """An entry from its text; of the kind 'unreadable' if it is none."""
    try:
        entry = json.loads(text)
        if isinstance(entry, dict) and isinstance(entry['step'], int) and 'kind' in entry:
            return entry
    except (ValueError, KeyError):
        pass
    return {'step': -1, 'kind': UNREADABLE, 'text': text, SEAL: ''}


def fault(entry: dict[str, Any], seal: str) -> str:
    """What is wrong with an entry behind the one with `seal`; '' if nothing, or if it is of a
    journal without seals."""
    if SEAL not in entry or entry[SEAL] == _seal(entry, seal):
        return ''
    return 'changed after it was written, or one before it is missing'


def told(entry: dict[str, Any]) -> str:
    """An entry in a few words."""
    names = f' {entry["name"]}' if 'name' in entry else ''
    return f'step {entry["step"]}, {entry["kind"]}{names}'


def _seal(entry: dict[str, Any], seal: str) -> str:
    text = seal + json.dumps({key: value for key, value in entry.items() if key != SEAL})
    return hashlib.sha256(text.encode()).hexdigest()[:_LENGTH]

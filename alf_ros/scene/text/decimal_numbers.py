"""Numbers as URDF, SDF, tables and the options of commands write them: decimal, as the C++ readers
of both formats take them.

Python's `float` and `int` take more, such as `1_000`, `infinity` and the digits of other scripts.
"""

from __future__ import annotations

import re

_DECIMAL = re.compile(
    r'[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf|nan)', re.IGNORECASE
)
_WHOLE = re.compile('[+-]?[0-9]+')


def decimal(word: str) -> float:
    """The number that a word writes, which may be infinite or none at all (`inf`, `nan`). Raises
    ValueError for a word that is not written so."""
    if _DECIMAL.fullmatch(word) is None:
        raise ValueError(word)
    return float(word)


def whole(word: str) -> int:
    """The whole number that a word writes. Raises ValueError for another word."""
    if _WHOLE.fullmatch(word) is None:
        raise ValueError(word)
    return int(word)

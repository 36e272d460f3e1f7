"""Digests of the source text of this package: what caches and stored measurements are keyed by."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def digest_now(*names: str) -> str:
    """Digest of all Python files below folders of this package, or of single files, named relative
    to it.

    Raises FileNotFoundError if one of the names is neither, or a folder without Python files: a
    file that has moved must not drop out of a digest in silence.
    """
    total = hashlib.sha256()
    for name in names:
        place = _PACKAGE / name
        files = [place] if place.is_file() else sorted(place.rglob('*.py'))
        if not files:
            raise FileNotFoundError(f'no source of this package: {name}')
        for file in files:
            total.update(f'{file.relative_to(_PACKAGE).as_posix()}\0'.encode())
            total.update(file.read_bytes() + b'\0')
    return total.hexdigest()


digest = cache(digest_now)  # as the files were when this process asked first

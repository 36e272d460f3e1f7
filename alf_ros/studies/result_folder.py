"""The folder of a result: a new scene and its report. No file that is not of the same study is
replaced, such as the scene that the study began with. All of this is known before it begins."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Collection
from pathlib import Path

from alf_ros import paths
from alf_ros.errors import InputError

REPORT = 'report.html'
_HEAD = 4096  # bytes in which the title of a report is


def check(folder: Path, names: Collection[str], title: str, key: str) -> None:
    """Raise InputError, which says `key`, if a folder cannot be made or written, or has files of
    these names that are not of an earlier run: beside a report with this title (HTML) they are."""
    there = folder
    while not os.path.lexists(there):
        there = there.parent
    try:
        with tempfile.TemporaryFile(dir=there):  # to see that it can be written
            pass
    except OSError as error:
        raise InputError(f'{error.strerror}', key=key, value=str(there)) from None
    found = [name for name in names if os.path.lexists(folder / name)]
    if found and not _is_own(folder / REPORT, title):
        raise InputError(
            'of something else, and left as it is',
            key=key,
            value=str(folder / found[0]),
            expected='another folder, or that file elsewhere',
        )


def _is_own(report: Path, title: str) -> bool:
    try:
        return f'<title>{title}</title>'.encode() in paths.head(report, _HEAD)
    except InputError:
        return False

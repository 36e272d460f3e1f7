"""The file of a report: beside its store, named after it, and never in place of another file."""

from __future__ import annotations

import html
import os
from pathlib import Path

from alf_ros import paths
from alf_ros.errors import InputError, printable

_HEAD = 4096  # bytes in which the mark is


def mark_of(store: Path) -> str:
    """The element in the head of a report that says of which store it is."""
    name = os.path.basename(os.path.abspath(store))
    return f'<meta name="alf_ros-store" content="{html.escape(printable(name))}">'


def beside(store: Path) -> Path:
    """The file for the report of a store: run.html of run.zarr, run.1.html of run.1. Raises
    InputError if a store has no place there, or another file than its own report."""
    place = Path(os.path.abspath(store))
    if not place.name or place.suffix == '.html':
        what = 'the name of a report' if place.name else 'not a folder of a store'
        raise InputError(what, key='--store', value=str(store), expected='such as run.zarr')
    report = place.with_name(f'{place.name.removesuffix(".zarr") or place.name}.html')
    _refuse_others(report, store, '--store', 'a store of another name')
    return report


def elsewhere(report: Path, store: Path) -> Path:
    """A chosen file for the report of a store. Raises InputError if its folder is not there, or if
    it is another file than the report of this store."""
    if not report.parent.is_dir():
        raise InputError('no such folder', key='--report', value=str(report.parent))
    _refuse_others(report, store, '--report', 'another name')
    return report


def _refuse_others(report: Path, store: Path, option: str, expected: str) -> None:
    """Raises InputError if another file than the report of a store is in its place."""
    if os.path.lexists(report) and not _is_own(report, store):
        raise InputError(
            'not the report of this store, and left as it is',
            key=option,
            value=str(report),
            expected=f'{expected}, or that file elsewhere',
        )


def _is_own(report: Path, store: Path) -> bool:
    try:
        return mark_of(store).encode() in paths.head(report, _HEAD)
    except InputError:
        return False

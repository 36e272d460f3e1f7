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
    if os.path.lexists(report) and not _is_own(report, place):
        raise InputError(
            'not the report of this store, and left as it is',
            key='--store',
            value=str(report),
            expected='a store of another name, or that file elsewhere',
        )
    return report


def _is_own(report: Path, store: Path) -> bool:
    try:
        return mark_of(store).encode() in paths.head(report, _HEAD)
    except InputError:
        return False

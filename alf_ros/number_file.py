"""Tables of numbers in CSV files: commas between columns, lines with # and one title skipped."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from alf_ros.document import LARGEST, SMALLEST
from alf_ros.errors import InputError


def read(path: Path) -> tuple[tuple[float, ...], ...]:
    """The rows of a file, all of the same length. Raises InputError."""
    file = str(path)
    if not path.is_file():
        raise InputError('no such file', file=file)
    rows: list[tuple[float, ...]] = []
    try:
        lines = path.read_text(encoding='utf-8-sig').splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'cannot be read: {error}', file=file) from None
    titled = False
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith('#'):
            continue
        (cells,) = csv.reader([line])
        row = tuple(map(_number, cells))
        if not (rows or titled) and all(map(math.isnan, row)):
            titled = True
            continue
        if any(math.isnan(x) for x in row):
            raise InputError('not a row of numbers', file=file, line=number, value=line)
        if rows and len(row) != len(rows[0]):
            expected = f'{len(rows[0])} columns'
            raise InputError('wrong number of columns', file=file, line=number, expected=expected)
        rows.append(row)
    if not rows:
        raise InputError('no numbers in the file', file=file)
    return tuple(rows)


def _number(cell: str) -> float:
    """The value of a cell, NaN if it has none that can be used."""
    try:
        value = float(cell)
    except ValueError:
        return math.nan
    return value if value == 0.0 or SMALLEST <= abs(value) <= LARGEST else math.nan

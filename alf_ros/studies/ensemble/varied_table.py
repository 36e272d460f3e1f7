"""A table of members in a CSV file: a line with the varied names, then a line for each member."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from alf_ros.errors import InputError
from alf_ros.scene.text.decimal_numbers import decimal
from alf_ros.scene.text.number_table import cells_of


class VariedTable(NamedTuple):
    """The values of each name, as texts that `fork --set` takes, and the line of each member."""

    file: str
    columns: dict[str, list[str]]
    lines: list[int]


def read(path: Path) -> VariedTable:
    """The table in a file. Raises InputError."""
    file, lines = str(path), cells_of(path)
    titled, names = next(lines, (None, []))
    for n, name in enumerate(names):
        error = None
        if ';' in name or '\t' in name:
            error = 'no commas between the columns'
        elif not name or _is_number(name):
            error = f'no name in column {n + 1}'
        elif name in names[:n]:
            error = 'named twice'
        if error is not None:
            expected = 'a line of names, such as coupler.mass'
            raise InputError(error, file=file, line=titled, value=name, expected=expected)
    rows: list[list[str]] = []
    numbers: list[int] = []
    for line, cells in lines:
        if len(cells) != len(names):
            expected = f'{len(names)} columns'
            raise InputError('wrong number of columns', file=file, line=line, expected=expected)
        if '' in cells:
            name = names[cells.index('')]
            raise InputError('an empty cell', file=file, line=line, key=name)
        rows.append(cells)
        numbers.append(line)
    if not rows:
        raise InputError('no members in the file', file=file)
    by_name = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
    return VariedTable(file, by_name, numbers)


def _is_number(word: str) -> bool:
    try:
        decimal(word)
    except ValueError:
        return False
    return True

"""Tables of numbers, in place or in CSV files: commas between columns, lines with # and one title
skipped."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from alf_ros import paths
from alf_ros.errors import InputError
from alf_ros.scene.references import References
from alf_ros.scene.text.decimal_numbers import decimal
from alf_ros.scene.text.yaml_document import LARGEST, LARGEST_FILE, SMALLEST, Entry, replaced
from alf_ros.scene.text.yaml_writer import entry as as_entry

Table = tuple[tuple[float, ...], ...]


class Tables:
    """Reads tables, and remembers tables from files. Paths are relative to the naming file."""

    def __init__(self, references: References) -> None:
        self._references = references
        self._from_file: dict[int, Entry] = {}

    def table(self, entry: Entry, numbers: Mapping[str, float]) -> Table:
        """The rows of a list of lists, or of the file it names. Raises InputError."""
        if isinstance(entry.value, str):
            if self._references.folder is None:
                raise entry.error('a file of numbers: files are not read here')
            folder = Path(entry.file).parent if entry.file is not None else Path()
            rows = read(folder / entry.text())
            self._from_file[id(entry)] = as_entry(rows)
            return rows
        rows = tuple(
            tuple(item.number(numbers) for item in row.sequence()) for row in entry.sequence()
        )
        if not rows:
            raise entry.error('an empty table', expected='rows of numbers, or a CSV file')
        if any(len(row) != len(rows[0]) for row in rows):
            raise entry.error('not a table', expected='rows of equal length')
        return rows

    def without_files(self, entry: Entry) -> Entry:
        """The entry, with tables from files written out."""
        return replaced(entry, self._from_file)


def cells_of(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line of a CSV file, without empty lines and comments (#). Raises
    InputError."""
    data = paths.content(path, LARGEST_FILE)
    try:
        lines = data.decode('utf-8-sig').splitlines()
    except UnicodeDecodeError as error:
        place = data.count(b'\n', 0, error.start) + 1
        raise InputError('not a text file in UTF-8', file=str(path), line=place) from None
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.lstrip().startswith('#'):
            try:
                (cells,) = csv.reader([line], skipinitialspace=True, strict=True)
            except csv.Error as error:  # such as a quote without its end
                text = f'not a line of a table: {error}'
                raise InputError(text, file=str(path), line=number) from None
            yield number, [cell.strip() for cell in cells]


def read(path: Path) -> Table:
    """The rows of a file, all of the same length. Raises InputError."""
    file = str(path)
    rows: list[tuple[float, ...]] = []
    titled = False
    for number, cells in cells_of(path):
        row = tuple(map(_number, cells))
        if not (rows or titled) and all(map(math.isnan, row)):
            titled = True
            continue
        if any(math.isnan(x) for x in row):
            column = 1 + [math.isnan(x) for x in row].index(True)
            text = f'not a row of numbers: column {column} of {len(row)} is none'
            raise InputError(text, file=file, line=number)
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
        value = decimal(cell)
    except ValueError:
        return math.nan
    return value if value == 0.0 or SMALLEST <= abs(value) <= LARGEST else math.nan

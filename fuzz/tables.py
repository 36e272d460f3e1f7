"""Tables of numbers: CSV files, whole ones damaged."""

from __future__ import annotations

import math
from random import Random

from spoiling import TEXTS, damaged, number, scratch

LONG = 200_000


class Harness:
    SUFFIX = '.csv'

    def __init__(self) -> None:
        self._path = scratch('tables') / 'table.csv'

    def make(self, random: Random) -> bytes:
        """A file."""
        columns, lines = random.choice((1, 2, 2, 3, 7)), []
        if random.randrange(3) == 0:
            lines.append(
                ','.join(random.choice(('t', 'x', '"a, b"', '', '1')) for _ in range(columns))
            )
        for row in range(random.choice((0, 1, 2, 5, 20))):
            cells = [repr(random.uniform(-9.0, 9.0)) for _ in range(columns)]
            if random.randrange(6) == 0:
                cells[random.randrange(columns)] = random.choice((str(number(random)), *TEXTS))
            lines.append(random.choice((',', ', ', ',', ';')).join(cells))
            if row and random.randrange(12) == 0:
                lines.append(random.choice(('', '#', '# x', ' ', ',', '"')))
        data = random.choice(('\n', '\n', '\r\n', '\r')).join(lines).encode('utf-8', 'replace')
        for _ in range(random.choice((0, 1, 1, 2))):
            data = damaged(data, random)
        return data

    def check(self, case: bytes) -> str:
        """Rows of equal length, of finite numbers, or one line."""
        from alf_ros.errors import InputError
        from alf_ros.scene.text.number_table import read

        self._path.write_bytes(case)
        try:
            rows = read(self._path)
        except InputError as error:
            assert str(error).isprintable() and len(str(error)) < 500
            return 'refused'
        assert rows and len({len(row) for row in rows}) == 1, 'silent: rows of other lengths'
        assert all(math.isfinite(x) for row in rows for x in row), 'silent: not finite'
        return 'ran'

"""Read results, and make tables of them."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

RESULTS = ROOT / 'benchmark' / 'results'


def rows(name: str) -> tuple[str, list[dict[str, str]]]:
    """The machine and versions, and the rows of a CSV file."""
    with open(RESULTS / name, encoding='utf-8') as stream:
        about = next(stream).lstrip('# ').strip()
        return about, list(csv.DictReader(stream))


def markdown(about: str, head: str, body: list[list[str]]) -> str:
    """A table below what it is about; `head`: the titles of its columns, a bar between."""
    columns = head.count('|') + 1
    lines = [f'| {head} |', '|---' * columns + '|', *(f'| {" | ".join(row)} |' for row in body)]
    return '\n'.join([f'{about}.\n', *lines]) + '\n'

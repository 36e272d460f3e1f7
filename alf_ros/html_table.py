"""Tables for the notebook: small, with every text escaped. Names come from files of anybody."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from itertools import islice

from alf_ros.errors import printable, shortened

MOST_ROWS = 30


def number(value: float) -> str:
    """Six digits."""
    return f'{value:.6g}'


def heading(text: str) -> str:
    """A line above tables."""
    return f'<p><b>{_escaped(text)}</b></p>'


def paragraph(text: str) -> str:
    """A line of text."""
    return f'<p>{_escaped(text)}</p>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]], count: int) -> str:
    """A table of the first `MOST_ROWS` of `count` rows, and how many more there are."""
    shown = [*islice(rows, MOST_ROWS)]
    lines = ['<table><thead>', _row('th', head), '</thead><tbody>']
    lines += [_row('td', row) for row in shown]
    lines.append('</tbody></table>')
    if count > len(shown):
        lines.append(paragraph(f'and {count - len(shown)} more'))
    return ''.join(lines)


def pairs(rows: Sequence[tuple[str, str]]) -> str:
    """A table of names and what they are."""
    lines = [f'<tr><th>{_escaped(name)}</th>{_cell(text)}</tr>' for name, text in rows]
    return f'<table><tbody>{"".join(lines)}</tbody></table>'


def _row(tag: str, cells: Sequence[str]) -> str:
    if tag == 'td':
        return f'<tr>{"".join(map(_cell, cells))}</tr>'
    return f'<tr>{"".join(f"<th>{_escaped(cell)}</th>" for cell in cells)}</tr>'


def _cell(text: str) -> str:
    return f'<td style="text-align: left">{_escaped(text)}</td>'


def _escaped(text: str) -> str:
    return html.escape(printable(shortened(text)))

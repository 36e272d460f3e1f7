"""One line of the table that `check` prints, and the words of lists and counts in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

OK, NOTE, BAD = 'ok', 'note', 'BAD'


@dataclass(frozen=True)
class Answer:
    """One line of the table: ok, note (worth knowing) or BAD (not sound)."""

    verdict: str
    question: str
    answer: str


def some(names: Sequence[str], most: int = 6) -> str:
    """The names, or the first of them and how many more there are."""
    return ', '.join(names[:most]) + (f' and {len(names) - most} more' if names[most:] else '')


def counted(n: int, what: str, plural: str = 's') -> str:
    """A number with its noun: '1 row', '2 rows'."""
    return f'{n} {what}{"" if n == 1 else plural}'

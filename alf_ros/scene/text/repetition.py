"""Many alike: `B<k>: {for: {k: [0, N]}, at: [k*L, L]}` stands for B0, B1 … BN.

The text between angle brackets is an expression with a whole value, which replaces it in names and
in references to names (`B<k-1>`). The index may be used in every number of the entry.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

from alf_ros.scene.text.expression import ExpressionError, evaluate, reserved
from alf_ros.scene.text.yaml_document import Entry

MOST = 200_000
TITLE = re.compile(r'[A-Za-z0-9_.-]{1,100}')
NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]{0,99}')


@dataclass(frozen=True, slots=True)
class Item:
    """One of the things an entry stands for: its name, its fields, the numbers known in them."""

    name: str
    entry: Entry
    fields: dict[str, Entry]
    names: Mapping[str, float]


def repeated(
    section: Entry, checked: Callable[[Entry], dict[str, Entry]], names: Mapping[str, float]
) -> Iterator[Item]:
    """All items of a section whose entries may be repeated, in order.

    `checked` gives the fields of an entry, among which `for` may be; see `keys`.
    """
    for key, entry in section.mapping().items():
        fields = checked(entry)
        loop = fields.pop('for', None)
        for scope in (names,) if loop is None else _scopes(loop, names):
            yield Item(filled(key, entry, scope), entry, fields, scope)


def keys(allowed: Iterable[str], required: Iterable[str]) -> Callable[[Entry], dict[str, Entry]]:
    """A check of entries that have these keys, whatever they say."""
    return partial(Entry.mapping, allowed=('for', *allowed), required=tuple(required))


def name(entry: Entry, names: Mapping[str, float]) -> str:
    """The name that `entry` refers to, its indices replaced."""
    return filled(entry.text(), entry, names)


def check_name(name: str, entry: Entry) -> None:
    """Refuse a name that nothing can have. Raises InputError."""
    if not NAME.fullmatch(name):
        expected = 'a letter, then letters, digits or _, 100 at most'
        raise entry.error('not a name', value=name, expected=expected)


def title(entry: Entry) -> str:
    """The name of a scene or a mechanism, which may become part of a file name."""
    if not TITLE.fullmatch(entry.text()):
        raise entry.error('not a name', expected='letters, digits, _, . and - only, 100 at most')
    return entry.text()


def _scopes(loop: Entry, names: Mapping[str, float]) -> Iterator[Mapping[str, float]]:
    """`names` and the indices, for each combination of their values, the last one fastest."""
    indices = loop.mapping()
    ranges, total = [], 1
    for index, bounds in indices.items():
        if index in names or reserved(index) or not NAME.fullmatch(index):
            raise bounds.error('an index that cannot be used', value=index, expected='a new name')
        first, last = (bound.integer(names) for bound in bounds.sequence(2))
        ranges.append(range(first, last + 1))
        total *= max(last + 1 - first, 0)
        if total > MOST:
            raise bounds.error(f'more than {MOST} repetitions')
    if not indices:
        raise loop.error('no index', expected='{k: [first, last]}')
    for values in itertools.product(*ranges):
        yield {**names, **dict(zip(indices, map(float, values), strict=True))}


def filled(template: str, entry: Entry, names: Mapping[str, float]) -> str:
    """A name with its `<expression>`s evaluated. Raises InputError."""
    if '<' not in template:
        return template
    text, expressions = _split(template)
    indices = []
    for expression in expressions:
        try:
            index = names[expression] if expression in names else evaluate(expression, names)
            if index != int(index):
                raise ExpressionError(f'{index:g} is not a whole number')
        except ExpressionError as error:
            message, value = f'index <{expression}>: {error}', error.name or template
            raise entry.error(message, value=value, choices=error.choices or None) from None
        indices.append(index)
    return text % tuple(indices)


@lru_cache(maxsize=4096)
def _split(template: str) -> tuple[str, tuple[str, ...]]:
    """Text with %d for each expression between angle brackets, and the expressions."""
    parts = re.split(r'<([^<>]*)>', template)
    return '%d'.join(part.replace('%', '%%') for part in parts[::2]), tuple(parts[1::2])

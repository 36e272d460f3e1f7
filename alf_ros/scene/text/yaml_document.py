"""YAML with positions: every value knows its file, line and key path, for error messages.

PyYAML only splits the text into events. The reader of a scalar decides its meaning, so `1e-3` is
always a number and `on` always a name. Tags are refused, and a key may occur only once.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml

from alf_ros import paths
from alf_ros.columns import ColumnText
from alf_ros.errors import InputError, shortened
from alf_ros.mechanism.time_function import Signal
from alf_ros.scene.text.expression import ExpressionError, evaluate, motion

T = TypeVar('T')

LARGEST, SMALLEST = 1e40, 1e-60  # so that products of several neither over- nor underflow
DEEPEST = 40
# 200,000 points have a million values. Each takes some 300 bytes; aliases of aliases would grow
# without bound.
MOST_NODES, LARGEST_FILE = 4_000_000, 1 << 26

NULL = frozenset(('', '~', 'null', 'Null', 'NULL'))
BOOLEAN = dict.fromkeys(('true', 'True', 'TRUE'), True) | dict.fromkeys(
    ('false', 'False', 'FALSE'), False
)
_UNPRINTABLE = re.compile('[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')
_Loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


@dataclass(frozen=True, eq=False, slots=True)
class Entry:
    """One value of a document: a scalar (`str`), a sequence (`tuple`) or a mapping (`dict`).

    `plain` is false for a quoted scalar. `line` is the line of the key, or of the item in a
    sequence; None without a text. `path` is the dotted key path. Every accessor raises InputError
    with all of them when the value has another type than requested.
    """

    value: str | tuple[Entry, ...] | dict[str, Entry]
    file: str | None = None
    line: int | None = None
    path: str = ''
    plain: bool = True

    @property
    def is_null(self) -> bool:
        """Whether the value is an unquoted null, such as `~`."""
        return self.plain and isinstance(self.value, str) and self.value in NULL

    def having(self, value: str | tuple[Entry, ...] | dict[str, Entry]) -> Entry:
        """The same with another value."""
        return Entry(value, self.file, self.line, self.path, self.plain)

    def error(self, message: str, *, value: object = None, **details: Any) -> InputError:
        """An InputError at this place; `value` defaults to the scalar as written, but never a
        whole file: the message must not reveal the content of a file."""
        if value is None and self.path and isinstance(self.value, str) and not self.is_null:
            value = self.value
        return InputError(
            message, file=self.file, line=self.line, key=self.path or None, value=value, **details
        )

    def wrong(self, expected: str) -> InputError:
        """The error of a value of another kind than `expected`."""
        if self.is_null:
            kind = 'nothing given'
        elif isinstance(self.value, str) and not self.path and self.file:
            # all of a file that is no scene, such as one of passwords: it is not shown
            text = f'a text of {len(self.value)} characters given'
            return InputError(text, file=self.file, line=self.line, expected=expected)
        elif isinstance(self.value, str):
            kind = 'wrong kind of value'
        else:
            is_list = isinstance(self.value, tuple)
            kind = f'a list of {len(self.value)} given' if is_list else 'a mapping given'
        return self.error(kind, expected=expected)

    def mapping(
        self, allowed: Collection[str] | None = None, required: Iterable[str] = ()
    ) -> dict[str, Entry]:
        """The mapping's entries by key, in order; nothing at all counts as an empty mapping."""
        if self.is_null:
            fields: dict[str, Entry] = {}
        elif isinstance(self.value, dict):
            fields = dict(self.value)
        else:
            raise self.wrong('a mapping {key: value, ...}')
        if allowed is not None:
            for key, entry in fields.items():
                if key not in allowed:
                    raise entry.error('unknown key', value=key, choices=allowed)
        for key in required:
            if key not in fields:
                raise self.error(f'missing key {key!r}')
        return fields

    def sequence(self, length: int | None = None) -> tuple[Entry, ...]:
        """The items of the sequence, of which there must be `length`."""
        if not isinstance(self.value, tuple) or length not in (None, len(self.value)):
            raise self.wrong('a list' if length is None else f'a list of {length}')
        return self.value

    def text(self, choices: Collection[str] | None = None) -> str:
        """The text of the scalar, which must be one of `choices`."""
        value = self.value
        if not isinstance(value, str) or (self.plain and value in NULL):
            raise self.wrong('a name')
        if choices is not None and value not in choices:
            raise self.error('unknown name', choices=choices)
        return value

    def boolean(self) -> bool:
        """The value of an unquoted `true` or `false`."""
        if isinstance(self.value, str) and self.plain and self.value in BOOLEAN:
            return BOOLEAN[self.value]
        raise self.wrong('true or false')

    def number(self, names: Mapping[str, float]) -> float:
        """The value of a number or an expression of `names`, and of a usable size."""
        if isinstance(self.value, ColumnText):
            value = self.value.column
        else:
            value = self._evaluated(evaluate, names)
        if abs(value) > LARGEST:
            raise self.error('too large', expected=f'{LARGEST:g} at most')
        if 0.0 < abs(value) < SMALLEST:
            raise self.error('too small', expected=f'0, or {SMALLEST:g} at least')
        return value

    def _evaluated(
        self, how: Callable[[str, Mapping[str, float]], T], names: Mapping[str, float]
    ) -> T:
        if not isinstance(self.value, str) or self.is_null:
            raise self.wrong('a number or an expression')
        try:
            return how(self.value, names)
        except ExpressionError as error:
            if error.name is None:
                raise self.error(str(error), expected='a number or an expression') from None
            raise self.error(
                f'{error} in {shortened(repr(self.value))}',
                value=error.name,
                choices=error.choices,
            ) from None

    def motion(self, names: Mapping[str, float]) -> Signal:
        """The value of an expression of `names` and t, the time."""
        return self._evaluated(motion, names)

    def integer(self, names: Mapping[str, float]) -> int:
        """The value of a number or an expression of `names` that is a whole number."""
        value = self.number(names)
        if value != int(value):
            raise self.error('not a whole number')
        return int(value)

    def vector(self, dimension: int, names: Mapping[str, float]) -> tuple[float, ...]:
        """`dimension` numbers."""
        return tuple(item.number(names) for item in self.sequence(dimension))


def replaced(entry: Entry, by: Mapping[int, Entry]) -> Entry:
    """The entry, with others in place of those entries in it whose identity is a key of `by`."""
    if not by:
        return entry
    value = entry.value
    if id(entry) in by:
        return by[id(entry)]
    if isinstance(value, dict):
        fields = {key: replaced(item, by) for key, item in value.items()}
        return entry.having(fields)
    if isinstance(value, tuple):
        return entry.having(tuple(replaced(item, by) for item in value))
    return entry


def read(path: Path) -> Entry:
    """The document in the file `path`."""
    file = str(path)
    data = paths.content(path, LARGEST_FILE)
    try:
        text = data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        line = data.count(b'\n', 0, error.start) + 1
        raise InputError('not a text file in UTF-8', file=file, line=line) from None
    return parse(text, file)


def parse(text: str, file: str | None) -> Entry:
    """The one document in `text`; `file` is the name that errors will give."""
    bad = _UNPRINTABLE.search(text)
    if bad:
        line = text.count('\n', 0, bad.start()) + 1
        raise InputError(
            f'character {ord(bad.group()):#04x} does not belong in a text', file=file, line=line
        )
    try:
        return _Reader(yaml.parse(text, Loader=_Loader), file).document()
    except yaml.MarkedYAMLError as error:
        problem = ' '.join(part for part in (error.context, error.problem) if part)
        marks: list[Any] = [mark for mark in (error.problem_mark, error.context_mark) if mark]
        lines = [mark.line + 1 for mark in marks] or [1]
        last = text.rstrip().count('\n') + 1
        if lines[0] > last:  # where the text ends something is open, which began before
            problem = f'{problem}: the file ends in it'
            lines = [*(line for line in lines if line <= last), last]
        raise InputError(f'not YAML: {problem}', file=file, line=lines[0]) from None
    except yaml.YAMLError as error:
        raise InputError(f'not YAML: {error}', file=file) from None


class _Reader:
    """Events to entries, with bounded depth and bounded growth by aliases."""

    def __init__(self, events: Iterator[yaml.Event], file: str | None) -> None:
        self.events, self.file = events, file
        self.anchors: dict[str, tuple[Entry, int]] = {}
        self.nodes = 0

    def document(self) -> Entry:
        next(self.events)  # the start of the stream
        if isinstance(next(self.events), yaml.StreamEndEvent):
            raise InputError('the file is empty', file=self.file, line=1, expected='a mapping')
        root = self.node(next(self.events), '', None, DEEPEST)
        next(self.events)  # the end of the document
        after = next(self.events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise self.error(after, '', 'a second document', expected='one document')
        return root

    def error(self, event: yaml.Event, path: str, message: str, **details: Any) -> InputError:
        return InputError(message, file=self.file, line=_line(event), key=path or None, **details)

    def node(self, event: Any, path: str, line: int | None, depth: int) -> Entry:
        line = line or _line(event)
        self.nodes += 1
        if self.nodes > MOST_NODES:
            raise self.error(event, path[:40], f'more than {MOST_NODES} values')
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event, path)
        if depth == 0:
            raise self.error(event, path[:40], f'nested more than {DEEPEST} deep')
        if event.tag is not None:
            raise self.error(event, path, 'a tag has no meaning here', value=event.tag)
        before, plain = self.nodes, True
        value: str | tuple[Entry, ...] | dict[str, Entry]
        if isinstance(event, yaml.ScalarEvent):
            value, plain = event.value, not event.style
        elif isinstance(event, yaml.SequenceStartEvent):
            value = tuple(self.items(path, depth - 1))
        else:
            value = self.fields(path, depth - 1)
        node = Entry(value, self.file, line, path, plain)
        if event.anchor:
            self.anchors[event.anchor] = node, self.nodes - before
        return node

    def alias(self, event: Any, path: str) -> Entry:
        if event.anchor not in self.anchors:
            raise self.error(event, path, 'alias of nothing, or of itself', value=event.anchor)
        node, size = self.anchors[event.anchor]
        self.nodes += size
        if self.nodes > MOST_NODES:
            raise self.error(event, path, f'aliases grow to more than {MOST_NODES} values')
        return node

    def items(self, path: str, depth: int) -> Iterator[Entry]:
        for i, event in enumerate(self.events):
            if isinstance(event, yaml.SequenceEndEvent):
                return
            yield self.node(event, f'{path}[{i}]', None, depth)

    def fields(self, path: str, depth: int) -> dict[str, Entry]:
        fields: dict[str, Entry] = {}
        for event in self.events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            if not isinstance(event, yaml.ScalarEvent) or event.tag is not None:
                raise self.error(event, path, 'a key must be a plain name')
            key = event.value
            if key in fields:
                first = f'it once, see line {fields[key].line}'
                raise self.error(event, path, 'key given twice', value=key, expected=first)
            inner = f'{path}.{key}' if path else key
            fields[key] = self.node(next(self.events), inner, _line(event), depth)
        return fields


def _line(event: Any) -> int:
    return int(event.start_mark.line) + 1

"""Entries from Python data, and entries to YAML text.

The text is ours, not a YAML library's, because its hash identifies a scene: the same scene must
give the same bytes whatever library is installed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from alf_ros.errors import InputError
from alf_ros.scene.text.yaml_document import BOOLEAN, DEEPEST, NULL, Entry

_PLAIN = re.compile(r'-?[A-Za-z0-9_.(/]([A-Za-z0-9_.()<>+*/% -]*[A-Za-z0-9_.()<>+*/%-])?')
_YAML_1_1 = frozenset(('y', 'n', 'yes', 'no', 'on', 'off'))  # booleans to other readers
_LINE_WIDTH = 88


def entry(data: object, file: str | None = None, path: str = '', depth: int = DEEPEST) -> Entry:
    """Python data (mappings, sequences, arrays, numbers, text, entries) as an Entry, no lines."""
    if isinstance(data, Entry):
        return data
    if depth == 0:
        raise InputError(f'nested more than {DEEPEST} deep', file=file, key=path[:40])
    if isinstance(data, Mapping):
        fields = {}
        for key, value in data.items():
            name = 'on' if key is True else str(key)  # what PyYAML makes of an unquoted `on`
            inner = f'{path}.{name}' if path else name
            fields[name] = entry(value, file, inner, depth - 1)
        return Entry(fields, file, None, path)
    if hasattr(data, 'tolist'):  # a numpy array or scalar
        data = data.tolist()
    if isinstance(data, Sequence) and not isinstance(data, (str, bytes)):
        items = (entry(value, file, f'{path}[{i}]', depth - 1) for i, value in enumerate(data))
        return Entry(tuple(items), file, None, path)
    if isinstance(data, (str, Path)):
        return Entry(str(data), file, None, path, plain=False)
    if data is None or isinstance(data, (bool, int, float)):
        try:
            return Entry('null' if data is None else str(data), file, None, path)
        except ValueError:  # Python refuses to print an integer of thousands of digits
            raise InputError('too large', file=file, key=path) from None
    raise InputError(
        'wrong kind of value',
        file=file,
        key=path or None,
        value=data,
        expected='a mapping, list, number, text or None',
    )


def serialise(root: Entry) -> str:
    """The mapping `root` as YAML that `parse` reads back to the same; numbers as written."""
    return ''.join(f'{line}\n' for line in _block(root, ''))


def _block(node: Entry, indent: str) -> Iterator[str]:
    """One line per key where that fits; the outermost mappings always in full."""
    for key, child in node.mapping().items():
        head = f'{indent}{_scalar(key, False)}:'
        # so many items fill a line by their brackets and commas alone
        long = not isinstance(child.value, str) and 3 * len(child.value) > _LINE_WIDTH
        flow = '' if long else _flow(child)
        wide = long or len(head) + len(flow) > _LINE_WIDTH
        if isinstance(child.value, dict) and child.value and (wide or not indent):
            yield head
            yield from _block(child, indent + '  ')
        elif isinstance(child.value, tuple) and child.value and wide:
            yield head
            yield from (f'{indent}  - {_flow(item)}' for item in child.value)
        else:
            yield f'{head} {flow}'


def _flow(node: Entry) -> str:
    if isinstance(node.value, str):
        return _scalar(node.value, node.plain)
    if isinstance(node.value, tuple):
        return f'[{", ".join(_flow(item) for item in node.value)}]'
    pairs = (f'{_scalar(key, False)}: {_flow(value)}' for key, value in node.value.items())
    return f'{{{", ".join(pairs)}}}'


@lru_cache(maxsize=4096)
def _scalar(text: str, plain: bool) -> str:
    """Unquoted only where no reader could take it for anything else."""
    if plain and text in NULL:
        return '~'
    word = text in NULL or text in BOOLEAN
    if _PLAIN.fullmatch(text) and text.lower() not in _YAML_1_1 and (plain or not word):
        return text
    escaped = ''.join(
        char if char.isprintable() and char not in '\\"' else f'\\U{ord(char):08x}'
        for char in text
    )
    return f'"{escaped}"'

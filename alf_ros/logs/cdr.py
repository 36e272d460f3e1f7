"""CDR, the bytes of ROS messages, read and written without ROS.

CDR as ROS 2 writes it (XCDR1, little endian): every number lies at a multiple of its own size,
counted from behind the four bytes of the header. A `Decoder` reads messages by the definition in a
log, an `Encoder` puts one together, and a `Template` is one of which only numbers change.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from alf_ros.errors import InputError

STAMP = struct.Struct('<iI')  # builtin_interfaces/Time: s, ns

_PRIMITIVE = {
    'bool': '?',
    'byte': 'B',
    'char': 'B',
    'int8': 'b',
    'uint8': 'B',
    'int16': 'h',
    'uint16': 'H',
    'int32': 'i',
    'uint32': 'I',
    'int64': 'q',
    'uint64': 'Q',
    'float32': 'f',
    'float64': 'd',
}
_FIELD = re.compile(
    r'(?P<type>[\w/]+)(<=\d+)?(?P<array>\[(?P<size>\d*|<=\d+)\])?\s+(?P<name>[a-z]\w*)\b(?!\s*=)'
)
_DEEPEST = 20  # types within types
BEGIN = b'\x00\x01\x00\x00'  # the header: CDR, little endian
_HEADER = len(BEGIN)
_ZSTD = b'\x28\xb5\x2f\xfd'  # the begin of a message that rosbag2 compressed by itself
# The stamp of a std_msgs/Header, which is the first field where there is one.
FIRST_STAMP = slice(_HEADER, _HEADER + STAMP.size)


class _Field(NamedTuple):
    name: str
    type: str
    array: bool
    size: int  # of an array of fixed size, else -1


Types = dict[str, tuple[_Field, ...]]


class Read(NamedTuple):
    """A message as a dictionary, and where it is in its bytes.

    `places` of its float64, in order; begin and end of its `parts`: all but bytes for alignment;
    the bytes `around` it: its header, and all bytes behind it.
    """

    message: dict[str, Any]
    places: list[int]
    parts: list[tuple[int, int]]
    around: bytes


class Decoder:
    """Reads messages of one type. `definition` is the text of the type and of all it is made of.

    Raises InputError if that is no definition of ROS.
    """

    def __init__(self, type_name: str, definition: str) -> None:
        self._types = _types(type_name, definition)
        self._root = _short(type_name)
        if not _complete(self._root, self._types):
            raise InputError('not a complete definition', value=type_name)

    def read(self, data: bytes) -> dict[str, Any]:
        """The message as a dictionary of numbers, texts, lists and dictionaries."""
        return self.read_with_places(data).message

    def read_with_places(self, data: bytes) -> Read:
        """The message, and where in `data` it is."""
        if data[:4] == _ZSTD:
            expected = 'messages that `ros2 bag convert` decompressed'
            raise InputError('a compressed message', value=self._root, expected=expected)
        if data[:2] != BEGIN[:2]:
            raise InputError('not little-endian CDR', value=self._root)
        reader = _Reader(data)
        try:
            message = self._message(self._root, reader)
        except (struct.error, UnicodeDecodeError):
            raise InputError('a message that is not of its type', value=self._root) from None
        around = data[:_HEADER] + data[reader.parts[-1][1] :]
        return Read(message, reader.places, reader.parts, around)

    def _message(self, name: str, reader: _Reader) -> dict[str, Any]:
        fields = self._types[name]
        if not fields:
            reader.number('B')  # a type without fields has one byte
        return {field.name: self._field(field, reader) for field in fields}

    def _field(self, field: _Field, reader: _Reader) -> Any:
        if not field.array:
            return self._one(field.type, reader)
        count = field.size if field.size >= 0 else reader.number('I')
        reader.expect(count)
        return [self._one(field.type, reader) for _ in range(count)]

    def _one(self, kind: str, reader: _Reader) -> Any:
        if kind == 'string':
            return reader.text()
        if kind in _PRIMITIVE:
            return reader.number(_PRIMITIVE[kind])
        return self._message(kind, reader)


class _Reader:
    """A place in the bytes of a message."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, _HEADER
        self._left = _DEEPEST * len(data)
        self.places: list[int] = []
        self.parts = [(0, _HEADER)]

    def expect(self, count: int) -> None:
        """So many values come: each has a byte at least, but for what holds nothing."""
        self._left -= count
        if self._left < 0:
            raise struct.error

    def number(self, code: str) -> Any:
        size = struct.calcsize(code)
        self._at += -(self._at - _HEADER) % size
        (value,) = struct.unpack_from('<' + code, self._data, self._at)
        if code == 'd':
            self.places.append(self._at)
        self.parts.append((self._at, self._at + size))
        self._at += size
        return value

    def text(self) -> str:
        length = self.number('I')
        raw = self._data[self._at : self._at + length]
        if len(raw) < length or raw[-1:] not in (b'\0', b''):  # a string ends with NUL
            raise struct.error
        self.parts.append((self._at, self._at + length))
        self._at += length
        return raw[:-1].decode()


class Encoder:
    """A message as it grows, field by field in the order of its definition."""

    def __init__(self) -> None:
        self.data = bytearray(BEGIN)

    def align(self, size: int) -> int:
        """Pad to a multiple of `size` (bytes). Returns the place of the next value."""
        self.data += bytes(-(len(self.data) - _HEADER) % size)
        return len(self.data)

    def integer(self, value: int) -> None:
        """Write a uint32, or the length of a sequence."""
        self.align(4)
        self.data += struct.pack('<I', value)

    def text(self, value: str) -> None:
        """Write a string."""
        raw = value.encode() + b'\0'
        self.integer(len(raw))
        self.data += raw

    def stamp(self) -> int:
        """Reserve space for a stamp. Returns its place."""
        at = self.align(4)
        self.data += bytes(STAMP.size)
        return at

    def numbers(self, count: int) -> int:
        """Reserve space for `count` float64. Returns their place."""
        at = self.align(8)
        self.data += bytes(8 * count)
        return at


class Template:
    """A message of which only stamps and numbers change.

    `stamps` are the places of its stamps in `data`, `blocks` place and count of its float64. Write
    numbers into the arrays `blocks`, which are views of the message, aligned as float64 are.
    """

    def __init__(
        self, data: bytes | bytearray, stamps: Iterable[int], blocks: Iterable[tuple[int, int]]
    ) -> None:
        # the header has half the size of a float64, and numbers are aligned behind it
        memory = np.empty(1 + -(-len(data) // 8), dtype=np.float64).view(np.uint8)
        self._data = memory[_HEADER : _HEADER + len(data)]
        self._data[:] = np.frombuffer(data, np.uint8)
        self._stamps = list(stamps)
        self._bytes = self._data.data
        self.blocks = tuple(
            self._data[at : at + 8 * count].view(np.float64) for at, count in blocks
        )

    def stamp(self, ns: int) -> None:
        """Write the stamp (ns)."""
        parts = divmod(ns, 1_000_000_000)
        for at in self._stamps:
            STAMP.pack_into(self._bytes, at, *parts)

    def bytes(self) -> bytes:
        """The message as it is now."""
        return self._data.tobytes()


def _complete(root: str, types: Types) -> bool:
    """Whether a type and all its parts are known, and no part contains itself."""
    done: set[str] = set()

    def whole(name: str, above: tuple[str, ...]) -> bool:
        if name in done:
            return True
        if name not in types or name in above or len(above) == _DEEPEST:
            return False
        plain, inside = (*_PRIMITIVE, 'string'), (*above, name)
        if not all(field.type in plain or whole(field.type, inside) for field in types[name]):
            return False
        done.add(name)
        return True

    return whole(root, ())


@lru_cache(maxsize=64)
def _types(root: str, definition: str) -> Types:
    """Fields of every type in a definition, by short name such as std_msgs/Header."""
    own, found = _short(root), {}
    parts = re.split(r'^=+\s*\nMSG: (\S+)[ \t]*$', definition, flags=re.MULTILINE)
    for name, text in zip([own, *parts[1::2]], parts[::2], strict=True):
        package = name.partition('/')[0]
        lines = (line.partition('#')[0].strip() for line in text.splitlines())
        matches = (_FIELD.match(line) for line in lines)
        found[_short(name)] = tuple(_field(match, package) for match in matches if match)
    return found


def _field(match: re.Match[str], package: str) -> _Field:
    kind = match['type']
    if kind not in _PRIMITIVE and kind != 'string':
        kind = _short(kind if '/' in kind else f'{package}/{kind}')
        kind = 'std_msgs/Header' if kind.endswith('/Header') else kind
    size = match['size'] or ''
    count = int(size[:10]) if size.isdigit() else -1
    return _Field(match['name'], kind, bool(match['array']), count)


def _short(name: str) -> str:
    return name.replace('/msg/', '/')

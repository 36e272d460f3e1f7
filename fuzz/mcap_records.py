"""MCAP files taken apart into records and put together again, so that single fields can be spoilt.

A chunk is taken apart as well: its records stand in `inner`, and are packed again, without
compression unless told, with sizes and checksum that fit unless they were changed on purpose.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
METADATA, DATA_END = 0x0C, 0x0F


@dataclass
class Record:
    """`head`: what a chunk says of itself in place of what would fit."""

    code: int
    content: bytes
    inner: list[Record] | None = None
    head: dict[str, Any] = field(default_factory=dict)

    def packed(self) -> bytes:
        """The bytes of the record."""
        content = self.content if self.inner is None else self._chunk()
        length = self.head.get('length', len(content))
        return struct.pack('<BQ', self.code, length) + content

    def _chunk(self) -> bytes:
        inside = b''.join(record.packed() for record in self.inner or ())
        told: dict[str, Any] = {
            'size': len(inside),
            'crc': zlib.crc32(inside),
            'compression': b'',
            'packed': None,
        }
        told.update({key: value for key, value in self.head.items() if key in told})
        data = inside
        if told['compression'] == b'zstd' and told['packed'] is None:
            import zstandard

            data = zstandard.ZstdCompressor().compress(inside)
        kind = told['compression']
        return (
            struct.pack('<QQQI', 0, 0, told['size'], told['crc'])
            + struct.pack('<I', len(kind))
            + kind
            + struct.pack('<Q', len(data) if told['packed'] is None else told['packed'])
            + data
        )


def records(data: bytes) -> list[Record]:
    """The records of the data section of a file, as far as they are whole.

    Raises ValueError for a chunk that is not what its checksum says, ZstdError, struct.error.
    """
    found = []
    for record in inner_records(data[len(MAGIC) :]):
        if record.code == CHUNK:
            record = Record(record.code, b'', inner_records(_unpacked(record.content)))
        found.append(record)
        if record.code == DATA_END:
            break
    return found


def _unpacked(chunk: bytes) -> bytes:
    """The records in the content of a chunk, unpacked."""
    import zstandard

    size, crc, length = struct.unpack_from('<QII', chunk, 16)
    packed, kind = chunk[32 + length + 8 :], chunk[32 : 32 + length]
    inside = zstandard.ZstdDecompressor().decompress(packed, size) if kind else packed
    if crc and zlib.crc32(inside) != crc:
        raise ValueError('another checksum')
    return inside


def inner_records(data: bytes) -> list[Record]:
    """The whole records of a chunk."""
    found, at = [], 0
    while at + 9 <= len(data):
        code, length = struct.unpack_from('<BQ', data, at)
        content = data[at + 9 : at + 9 + length]
        if len(content) < length:
            break
        found.append(Record(code, content))
        at += 9 + length
    return found


def behind(data: bytes) -> bytes:
    """The bytes behind the data section of a whole file: its index and its end."""
    at = len(MAGIC)
    while data[at] != DATA_END:
        (length,) = struct.unpack_from('<Q', data, at + 1)
        at += 9 + length
    (length,) = struct.unpack_from('<Q', data, at + 1)
    return data[at + 9 + length :]


def together(parts: list[Record], end: bytes = b'') -> bytes:
    """A whole file, with such an end, or one without an index."""
    footer = struct.pack('<BQQQI', FOOTER, 20, 0, 0, 0)
    return MAGIC + b''.join(part.packed() for part in parts) + (end or footer + MAGIC)


def text(value: str | bytes) -> bytes:
    """A string of a record."""
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack('<I', len(raw)) + raw


def mapping(pairs: dict[str, str]) -> bytes:
    """A map of a record."""
    inside = b''.join(text(k) + text(v) for k, v in pairs.items())
    return struct.pack('<I', len(inside)) + inside


def read_text(content: bytes, at: int) -> tuple[bytes, int]:
    """A string of a record, and where it ends."""
    (length,) = struct.unpack_from('<I', content, at)
    return content[at + 4 : at + 4 + length], at + 4 + length


def read_mapping(content: bytes, at: int) -> dict[str, str]:
    """A map of a record."""
    (length,) = struct.unpack_from('<I', content, at)
    at, end, found = at + 4, at + 4 + length, {}
    while at < end:
        key, at = read_text(content, at)
        value, at = read_text(content, at)
        found[key.decode()] = value.decode()
    return found

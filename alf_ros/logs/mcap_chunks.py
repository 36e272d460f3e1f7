"""MCAP files, read from the front: chunk by chunk, whole or cut off, in bounded memory.

The format is defined at https://mcap.dev/spec. An index is not needed, because a log that was
killed has none; and messages do not become objects, because a log may have ten million.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from alf_ros.arrays import Integers
from alf_ros.errors import InputError
from alf_ros.kernel.numba_ext.jit import compiled

MAGIC = b'\x89MCAP0\r\n'
SCHEMA, CHANNEL, MESSAGE, CHUNK, METADATA, DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0C, 0x0F
FOOTER, STATISTICS = 0x02, 0x0B
# Longest record, and largest chunk, that is accepted (bytes): larger ones mean a broken file.
_LONGEST = 1 << 28
_HEAD = 31  # bytes of a message record before its data
_COUNTS = 46  # bytes of a Statistics record before its counts

Bytes = NDArray[np.uint8]


@dataclass
class Channel:
    """A topic in a file: its type, the definition of the type, and how it was offered."""

    id: int
    topic: str
    encoding: str
    metadata: dict[str, str]
    type: str
    definition: str


@dataclass
class Contents:
    """Properties of a file, as far as it was read: `damage` is the first unreadable place, ''
    without one; `passed_over` one with readable parts behind it. `counts` are the messages of each
    topic that the index at the end of the file states; None without a readable index."""

    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    profile: str = ''
    damage: str = ''
    passed_over: str = ''
    counts: dict[str, int] | None = None


@dataclass(frozen=True)
class Block:
    """The messages of one chunk in the order written.

    `data` are the bytes of the chunk; message k of channel `channel[k]`, with stamp `stamp[k]`
    (ns) and number `sequence[k]` of its topic, lies at `start[k]` to `end[k]`.
    """

    data: Bytes
    channel: Integers
    sequence: Integers
    stamp: Integers
    start: Integers
    end: Integers
    read: int  # bytes of the file up to here

    def message(self, k: int) -> bytes:
        """The data of message k."""
        return self.data[self.start[k] : self.end[k]].tobytes()


def blocks(path: Path, contents: Contents, begin: int = 0) -> Iterator[Block]:
    """Every whole chunk of a file; `contents` grows as they are read.

    `begin`: the byte at which a chunk begins, to leave out those before; `contents` must know
    their channels.

    A file that is cut off ends at its last whole chunk; chunks with a wrong checksum are passed
    over. Raises InputError if it is no MCAP file at all.
    """
    schemas: dict[int, tuple[str, str]] = {}
    with _opened(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        try:
            head = stream.read(len(MAGIC))
        except OSError as error:
            raise InputError(f'cannot be read: {error.strerror}', file=str(path)) from None
        if head != MAGIC[: len(head)]:
            raise InputError('not an MCAP file', file=str(path))
        stream.seek(max(begin, len(head)))
        while True:
            at = stream.tell()
            try:
                code, content = _record(stream, size - at)
                if code == DATA_END:
                    behind = stream.tell()
                    stream.seek(max(0, size - len(MAGIC)))
                    if stream.read() != MAGIC:
                        raise _Damaged('index cut off', ends=True)
                    stream.seek(behind)
                    contents.counts = _counts(stream, size, contents)
                    return
                if code == CHUNK:
                    yield _block(_unpacked(content), contents, schemas, stream.tell())
                elif code == MESSAGE:  # of a file without chunks
                    record = struct.pack('<BQ', code, len(content)) + content
                    yield _block(record, contents, schemas, stream.tell())
                else:
                    _note(code, content, contents, schemas)
            except _Damaged as damaged:
                told = f'{damaged} at byte {at}'
                contents.damage = contents.damage or told
                if damaged.ends:
                    return
                contents.passed_over = contents.passed_over or told


def described(path: Path, name: str) -> Contents:
    """The head of a file up to its messages, and the metadata of this name also behind them, where
    other programs that write a log again may put it. Messages there are passed over.

    Raises InputError if it is no MCAP file at all.
    """
    contents = Contents()
    for _ in blocks(path, contents):
        break
    if name in contents.metadata:
        return contents
    with _opened(path) as stream, suppress(_Damaged, OSError):
        size, code = os.fstat(stream.fileno()).st_size, 0
        stream.seek(len(MAGIC))
        while code != DATA_END and name not in contents.metadata:
            code, length = _header(stream, size - stream.tell())
            if code == METADATA:
                _note(code, stream.read(length), contents, {})
            else:
                stream.seek(length, os.SEEK_CUR)
    return contents


class _Damaged(Exception):
    """An unreadable part: a record, or the remainder if the file `ends` with it."""

    def __init__(self, what: str, ends: bool = False) -> None:
        super().__init__(what)
        self.ends = ends


def _opened(path: Path) -> BinaryIO:
    try:
        return open(path, 'rb')
    except (OSError, ValueError) as error:
        raise InputError(
            f'cannot be read: {getattr(error, "strerror", error)}', file=str(path)
        ) from None


def _record(stream: BinaryIO, left: int) -> tuple[int, bytes]:
    try:
        return _read(stream, left)
    except OSError as error:  # of a disk
        raise _Damaged(f'{error.strerror}', ends=True) from None


def _header(stream: BinaryIO, left: int) -> tuple[int, int]:
    """The code of the record that begins here, and its length (bytes)."""
    head = stream.read(9)
    if len(head) < 9:
        raise _Damaged('cut off', ends=True)
    code, length = struct.unpack('<BQ', head)
    if length > _LONGEST:
        raise _Damaged('broken', ends=True)
    if length > left - len(head):  # memory is reserved only for existing data
        raise _Damaged('cut off', ends=True)
    return code, length


def _read(stream: BinaryIO, left: int) -> tuple[int, bytes]:
    code, length = _header(stream, left)
    content = stream.read(length)
    if len(content) < length:
        raise _Damaged('cut off', ends=True)
    return code, content


def _counts(stream: BinaryIO, size: int, contents: Contents) -> dict[str, int] | None:
    """Messages of each topic as the record Statistics, in the index from here on, states them."""
    try:
        code = DATA_END
        while code != STATISTICS:
            code, content = _record(stream, size - stream.tell())
            if code == FOOTER:
                return None
        (length,) = struct.unpack_from('<I', content, _COUNTS - 4)
        found: dict[str, int] = {}
        for id_, count in struct.iter_unpack('<HQ', content[_COUNTS : _COUNTS + length]):
            topic = contents.channels[id_].topic
            found[topic] = found.get(topic, 0) + count
    except (_Damaged, struct.error, KeyError):
        return None
    return found


def _unpacked(content: bytes) -> bytes:
    """The records of a chunk."""
    try:
        _, _, size, crc = struct.unpack_from('<QQQI', content)
        compression, at = _text(content, 28)
        (length,) = struct.unpack_from('<Q', content, at)
        if size > _LONGEST:
            raise _Damaged('broken chunk')
        packed = content[at + 8 : at + 8 + length]
        data = _decompressed(compression, packed, size)
    except (struct.error, UnicodeDecodeError, IndexError):
        raise _Damaged('broken chunk') from None
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise _Damaged('chunk with a wrong checksum')
    return data


def _decompressed(compression: str, packed: bytes, size: int) -> bytes:
    # The compressor is imported where a file needs it.
    if not compression:
        return packed
    if compression == 'zstd':
        import zstandard

        try:
            # decompression reserves the size in the frame, even if the chunk states less
            if zstandard.frame_content_size(packed) > size:
                raise _Damaged('broken chunk')
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        except zstandard.ZstdError:
            raise _Damaged('broken chunk') from None
    if compression == 'lz4':
        import lz4.frame

        try:
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
        except RuntimeError:
            raise _Damaged('broken chunk') from None
    raise _Damaged(f'chunk of unknown compression {compression[:20]!r}')


def _block(
    records: bytes, contents: Contents, schemas: dict[int, tuple[str, str]], read: int
) -> Block:
    data = np.frombuffer(records, np.uint8)
    starts = _starts(data)
    if starts.size and starts[-1] < 0:
        raise _Damaged('broken chunk')
    codes = data[starts]
    for at in starts[codes != MESSAGE]:
        (length,) = struct.unpack_from('<Q', records, at + 1)
        _note(int(data[at]), records[at + 9 : at + 9 + length], contents, schemas)
    starts = starts[codes == MESSAGE]
    channel = _integers(data, starts + 9, '<u2')
    if set(np.unique(channel)) - contents.channels.keys():
        raise _Damaged('message without a channel')
    stamp = _integers(data, starts + 15, '<i8')
    if stamp.size and stamp.min() < 0:  # the file holds 64 bit without sign, ROS time 63
        raise _Damaged('stamp beyond 2**63 ns')
    return Block(
        data,
        channel,
        _integers(data, starts + 11, '<u4'),
        stamp,
        starts + _HEAD,
        starts + 9 + _integers(data, starts + 1, '<i8'),
        read,
    )


@compiled
def _starts(data: Bytes) -> Integers:
    """Where each record starts; -1 is the last if they do not fill the chunk."""
    starts = np.empty(data.size // 9 + 1, np.int64)
    count, at = 0, np.int64(0)
    while at < data.size:
        length, whole = np.int64(-1), at + 9 <= data.size
        if whole:
            length = np.int64(0)
            for k in range(8):
                length |= np.int64(data[at + 1 + k]) << (8 * k)
            least = _HEAD - 9 if data[at] == MESSAGE else 0
            whole = least <= length <= data.size - at - 9
        starts[count] = at if whole else -1
        count += 1
        if not whole:
            break
        at += 9 + length
    return starts[:count].copy()


def _integers(data: Bytes, at: Integers, kind: str) -> Integers:
    """Little-endian integers at these places."""
    size = np.dtype(kind).itemsize
    return data[at[:, None] + np.arange(size)].view(kind)[:, 0].astype(np.int64)


def _note(
    code: int, content: bytes, contents: Contents, schemas: dict[int, tuple[str, str]]
) -> None:
    """Keep what a record says that is no message."""
    try:
        if code == SCHEMA:
            (id_,) = struct.unpack_from('<H', content)
            name, at = _text(content, 2)
            _, at = _text(content, at)
            schemas[id_] = name, _text(content, at)[0]
        elif code == CHANNEL:
            id_, schema = struct.unpack_from('<HH', content)
            topic, at = _text(content, 4)
            encoding, at = _text(content, at)
            name, definition = schemas.get(schema, ('', ''))
            found = Channel(id_, topic, encoding, _map(content, at), name, definition)
            contents.channels[id_] = found
        elif code == METADATA:
            name, at = _text(content, 0)
            contents.metadata[name] = _map(content, at)
        elif code == 0x01:
            contents.profile, _ = _text(content, 0)
    except (struct.error, UnicodeDecodeError, IndexError):
        raise _Damaged('broken record') from None


def _text(content: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from('<I', content, at)
    end = at + 4 + length
    if end > len(content):
        raise IndexError
    return content[at + 4 : end].decode(), end


def _map(content: bytes, at: int) -> dict[str, str]:
    (length,) = struct.unpack_from('<I', content, at)
    at, end, found = at + 4, at + 4 + length, {}
    while at < end:
        key, at = _text(content, at)
        found[key], at = _text(content, at)
    return found

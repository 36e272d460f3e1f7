"""The chunk of an MCAP file that is being filled: its records, and the places of its messages.

Its memory is used again for the next chunk, and the compressor keeps its own: fresh memory for
each chunk would cost as much as compressing it. A node that begins log after log must not grow.
So the memory is pages of its own, which the system takes back at the end of a log, and the next
log uses the same compressors. In the heap, blocks of ever other sizes would leave holes between
other blocks. The format is defined at https://mcap.dev/spec.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from typing import Any

from mcap.data_stream import RecordBuilder

try:
    import zstandard
except ImportError:  # the file is not compressed then
    zstandard = None  # type: ignore[assignment]

_MESSAGE, _CHUNK, _MESSAGE_INDEX = 0x05, 0x06, 0x07
_MESSAGE_HEAD = struct.Struct('<BQHIQQ')
_CHUNK_HEAD = struct.Struct('<BQQQQI')
_INDEX_HEAD = struct.Struct('<BQHI')
_PLACE = struct.Struct('<QQ')
_RECORD_HEAD = 9  # bytes of code and length
# Chunks that fill fast are compressed fast: for the writer to follow is worth more than a third of
# their size.
_LARGE = 1 << 20
_SMALL_LEVEL, _LARGE_LEVEL = 3, -1
_PIECE = 1 << 16  # bytes
_spare: list[_Compressors] = []  # of logs that have ended


class _Compressors:
    """One for small chunks, one for large ones; None without the library."""

    def __init__(self) -> None:
        self.small, self.large = (
            zstandard.ZstdCompressor(level=level) if zstandard else None
            for level in (_SMALL_LEVEL, _LARGE_LEVEL)
        )


class ChunkMemory:
    """Records of one chunk after another. Of schemas and channels, which `mcap.Writer` registers
    here, it is the chunk builder."""

    num_messages = 0  # that the Writer is to write: it is left to `packed`

    def __init__(self, capacity: int) -> None:
        self._memory = _pages(capacity)
        self._compressors = _spare.pop() if _spare else _Compressors()
        self.reset()

    def reset(self) -> None:
        """Begin a chunk."""
        self.count = 0  # bytes
        self.start, self.end = 2**63, 0  # stamps, ns
        self._places: dict[int, bytearray] = {}

    def release(self) -> None:
        """Give the memory back: there is no further chunk."""
        self._memory = memoryview(bytearray())
        _spare.append(self._compressors)
        del self._compressors
        self.reset()

    @property
    def messages(self) -> dict[int, int]:
        """How many messages of each channel it has."""
        return {id_: len(places) // _PLACE.size for id_, places in self._places.items()}

    @property
    def compression(self) -> str:
        """Its name in the file."""
        return 'zstd' if zstandard else ''

    def add_schema(self, schema: Any) -> None:
        """Take the record of a schema."""
        self._add_record(schema)

    def add_channel(self, channel: Any) -> None:
        """Take the record of a channel."""
        self._add_record(channel)

    def add_message(self, channel: int, stamp: int, data: bytes, number: int) -> None:
        """Take a message, the `number`th of its channel."""
        at, size = self.count, len(data)
        behind = at + _MESSAGE_HEAD.size
        self._reserve(behind + size)
        length = _MESSAGE_HEAD.size - _RECORD_HEAD + size
        _MESSAGE_HEAD.pack_into(self._memory, at, _MESSAGE, length, channel, number, stamp, stamp)
        self._memory[behind : behind + size] = data
        self.count = behind + size
        places = self._places.get(channel)
        if places is None:
            places = self._places[channel] = bytearray()
        places += _PLACE.pack(stamp, at)
        if stamp < self.start:
            self.start = stamp
        if stamp > self.end:
            self.end = stamp

    def packed(self) -> list[bytes]:
        """The Chunk record, in pieces."""
        records = self._memory[: self.count]
        pieces = self._compressed(records)
        size, name = sum(map(len, pieces)), self.compression.encode()
        length = _CHUNK_HEAD.size - _RECORD_HEAD + 4 + len(name) + 8 + size
        head = _CHUNK_HEAD.pack(
            _CHUNK, length, self.start, self.end, self.count, zlib.crc32(records)
        )
        return [head + struct.pack(f'<I{len(name)}sQ', len(name), name, size), *pieces]

    def _compressed(self, records: memoryview) -> list[bytes]:
        which = self._compressors
        compressor = which.large if self.count > _LARGE else which.small
        if compressor is None:
            return [bytes(records)]
        chunker = compressor.chunker(chunk_size=_PIECE)
        return [*chunker.compress(records), *chunker.finish()]

    def indices(self) -> dict[int, bytes]:
        """The MessageIndex record of each channel."""
        return {
            id_: _INDEX_HEAD.pack(_MESSAGE_INDEX, 6 + len(places), id_, len(places)) + places
            for id_, places in self._places.items()
        }

    def _add_record(self, record: Any) -> None:
        builder = RecordBuilder()
        record.write(builder)
        data = builder.end()
        self._reserve(self.count + len(data))
        self._memory[self.count : self.count + len(data)] = data
        self.count += len(data)

    def _reserve(self, size: int) -> None:
        if size > len(self._memory):
            larger = _pages(max(size, 2 * len(self._memory)))
            larger[: self.count] = self._memory[: self.count]
            self._memory = larger


def _pages(size: int) -> memoryview:
    """Memory of so many bytes, all zero, outside the heap; it ends with its last view."""
    return memoryview(mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS))

"""One MCAP file of a log. What `flush` handed to the system is whole whatever happens later."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from alf_ros.errors import InputError
from alf_ros.ros.recording import rosbag2_metadata

try:
    from mcap.data_stream import RecordBuilder
    from mcap.records import ChunkIndex
    from mcap.writer import CompressionType, Writer

    from alf_ros.ros.recording.chunk_memory import ChunkMemory
except ModuleNotFoundError as error:  # no package of a distribution brings it
    if (error.name or '').partition('.')[0] != 'mcap':
        raise
    Writer = None  # type: ignore[assignment, misc]
try:
    import zstandard
except ImportError:
    zstandard = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

CHUNK_SIZE = 4 << 20
CAN_WRITE = Writer is not None
HOW = 'pip install "mcap>=1.5" zstandard'


def lacking() -> str:
    """The missing libraries for logs, or for small logs, and how to get them; '' if none is
    missing."""
    if Writer is None:
        return f'no log can be written: the library mcap is missing; {HOW}'
    if zstandard is None:
        return f'logs are not compressed: the library zstandard is missing; {HOW}'
    return ''


class _Stream:
    """A file without a buffer of its own; `good` is how far its chunks are whole."""

    def __init__(self, path: Path) -> None:
        self.path, self.good, self.size = path, 0, 0
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)

    def write(self, data: bytes) -> int:
        """All of it, or OSError."""
        left = memoryview(data)
        while left:
            written = os.write(self._file, left)
            self.size += written
            left = left[written:]
        return len(data)

    def tell(self) -> int:
        """Bytes written so far."""
        return self.size

    def flush(self) -> None:
        """There is nothing to flush."""

    def check(self) -> None:
        """Raise OSError if the file has been moved or deleted: later data would not be found."""
        found = os.stat(self.path)
        if self._file >= 0 and not os.path.samestat(found, os.fstat(self._file)):
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))

    @property
    def there(self) -> bool:
        """Whether the file is where it was."""
        try:
            self.check()
        except OSError:
            return False
        return True

    def cut(self) -> None:
        """Truncate to the last whole chunk."""
        if self._file >= 0:
            os.ftruncate(self._file, self.good)

    def close(self) -> None:
        """Close the file. Further calls do nothing."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)


class _Written(bytes):
    """A record that is written already."""

    __slots__ = ()

    def write(self, stream: RecordBuilder) -> None:
        """As records do."""
        stream.write(self)


class _ChunkIndices(list[_Written]):
    """A list of records that keeps their bytes: a sixth of the memory of the objects."""

    def append(self, index: Any) -> None:
        """Take a record."""
        builder = RecordBuilder()
        index.write(builder)
        super().append(_Written(builder.end()))


class LogFile:
    """Messages as an MCAP file that rosbag2 and Foxglove open; methods raise OSError.

    `info` (str -> str) becomes the Metadata record `alf_ros`. Raises InputError without mcap.
    Without zstandard the file is not compressed.
    """

    def __init__(self, path: Path, info: dict[str, str]) -> None:
        if Writer is None:
            raise InputError(lacking())
        self.path = path
        self.channels: dict[str, rosbag2_metadata.RecordedTopic] = {}
        self.start, self.end = 2**63, 0  # stamps, ns
        self._schemas: dict[str, int] = {}
        self._info = info
        self._kept = 0
        self._stream = _Stream(path)
        self._chunk = ChunkMemory(CHUNK_SIZE + (CHUNK_SIZE >> 2))
        self._writer = Writer(
            self._stream,  # type: ignore[arg-type]
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.ZSTD if zstandard else CompressionType.NONE,
        )
        # The chunks are written here, in the memory of one: see ChunkMemory.
        self._writer._Writer__chunk_builder = self._chunk  # type: ignore[attr-defined]
        # A day has 170,000 chunks: their index waits for the end of the file as bytes.
        self._writer._Writer__chunk_indices = _ChunkIndices()  # type: ignore[attr-defined]
        self._writer.start(profile='ros2', library='alf_ros')
        self._writer.add_metadata('alf_ros', info)
        self._stream.good = self._stream.size

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._stream.size

    @property
    def count(self) -> int:
        """Messages in the file, and in the chunk that is still open."""
        return sum(channel.count for channel in self.channels.values())

    @property
    def kept(self) -> int:
        """Messages that are in the file whatever happens to this process; 0 if it is gone."""
        return self._kept if self._stream.there else 0

    @property
    def span(self) -> int:
        """From the first stamp to the last, ns."""
        return max(0, self.end - self.start)

    def add(
        self, topic: str, kind: type, qos: QoSProfile, stamp: int, data: bytes, number: int
    ) -> None:
        """Write one serialised message, the `number`th of its topic."""
        channel = self.channels.get(topic)
        if channel is None:
            name = rosbag2_metadata.type_name(kind)
            channel = self.register(
                topic,
                name,
                rosbag2_metadata.definition(name),
                rosbag2_metadata.type_hash(name),
                rosbag2_metadata.qos_text(qos),
            )
        self.add_to(channel, stamp, data, number)

    def register(
        self, topic: str, name: str, definition: str, type_hash: str, qos: str
    ) -> rosbag2_metadata.RecordedTopic:
        """A topic of type `name`."""
        if name not in self._schemas:
            schema = self._writer.register_schema(name, 'ros2msg', definition.encode())
            self._schemas[name] = schema
        about = {'offered_qos_profiles': qos, 'topic_type_hash': type_hash}
        id_ = self._writer.register_channel(topic, 'cdr', self._schemas[name], about)
        channel = self.channels[topic] = rosbag2_metadata.RecordedTopic(
            id_, topic, name, qos, type_hash
        )
        return channel

    def add_to(
        self, channel: rosbag2_metadata.RecordedTopic, stamp: int, data: bytes, number: int
    ) -> None:
        """Write one serialised message of a registered topic."""
        if self._chunk.count > CHUNK_SIZE:
            self._end_chunk()
        self._chunk.add_message(channel.id, stamp, data, number)
        channel.count += 1
        self.start, self.end = min(self.start, stamp), max(self.end, stamp)

    def note(self, name: str, about: dict[str, str]) -> None:
        """Write a Metadata record."""
        self._writer.add_metadata(name, about)

    def flush(self) -> None:
        """Close the chunk and hand it to the system."""
        self._end_chunk()
        self._writer.flush()
        self._stream.check()
        self._stream.good, self._kept = self._stream.size, self.count

    def _end_chunk(self) -> None:
        """Write the chunk with the places of its messages, if it has any."""
        chunk, counts = self._chunk, self._chunk.messages
        if not counts:
            return
        self._writer.flush()  # what was registered since the last one
        begin = self._stream.size
        pieces = chunk.packed()
        for piece in pieces:
            self._stream.write(piece)
        behind, places = self._stream.size, {}
        for id_, record in chunk.indices().items():
            places[id_] = self._stream.size
            self._stream.write(record)
        index = ChunkIndex(
            message_start_time=chunk.start,
            message_end_time=chunk.end,
            chunk_start_offset=begin,
            chunk_length=behind - begin,
            message_index_offsets=places,
            message_index_length=self._stream.size - behind,
            compression=chunk.compression,
            compressed_size=sum(map(len, pieces[1:])),
            uncompressed_size=chunk.count,
        )
        self._writer._Writer__chunk_indices.append(index)  # type: ignore[attr-defined]
        statistics = self._writer._Writer__statistics  # type: ignore[attr-defined]
        statistics.chunk_count += 1
        first = chunk.start if statistics.message_count == 0 else statistics.message_start_time
        statistics.message_start_time = min(first, chunk.start)
        statistics.message_end_time = max(statistics.message_end_time, chunk.end)
        for id_, count in counts.items():
            statistics.channel_message_counts[id_] += count
            statistics.message_count += count
        chunk.reset()

    def finish(self) -> None:
        """Write the summary and close the file."""
        self._end_chunk()
        text = yaml.safe_dump(
            rosbag2_metadata.metadata([self.summary()], self.channels.values(), self._info),
            sort_keys=False,
            allow_unicode=True,
        )
        self._writer.add_metadata('rosbag2', {'serialized_metadata': text})
        self._writer.finish()
        self._stream.check()
        self._kept = self.count
        self._stream.close()
        self._chunk.release()

    def summary(self) -> rosbag2_metadata.File:
        """The entry of the file in metadata.yaml."""
        return rosbag2_metadata.File(
            self.path.name, min(self.start, self.end), self.end, self.count
        )

    def abandon(self) -> None:
        """Close the file with its whole chunks only, after an error."""
        try:
            self._stream.cut()
        finally:
            self._stream.close()


def write_metadata(folder: Path, files: Sequence[LogFile], info: Mapping[str, str]) -> None:
    """Write metadata.yaml beside the files of a log. Raises OSError."""
    channels = [channel for file in files for channel in file.channels.values()]
    summaries = [file.summary() for file in files]
    rosbag2_metadata.write_metadata(folder, summaries, channels, info)

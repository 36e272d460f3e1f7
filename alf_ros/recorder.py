"""Serialised messages -> an MCAP log that `ros2 bag play` and Foxglove open.

A thread of its own writes: finishing a chunk takes milliseconds that a step does not have.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from mcap.writer import CompressionType, Writer

from alf_ros import bag
from alf_ros.errors import InputError

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

# Seconds of wall time after which a chunk is closed and handed to the system, so that a kill loses
# less than a second; and between two looks into the queue.
CHUNK_PERIOD = 0.5
LOOK_PERIOD = 0.02
CHUNK_SIZE = 4 << 20
QUEUE_SIZE = 64 << 20


class Recorder:
    """Writes one run to `<folder>/<scene>_<UTC time>/<the same>_0.mcap`.

    `info` (str -> str) says what is needed to repeat the run; it becomes the Metadata record
    `alf_ros` and rosbag2's `custom_data`. `queue_size` (bytes) bounds what waits to be written:
    what comes on top is dropped and counted, so that `write` never waits for the disk.

    Raises `InputError` when the folder cannot be made or written.
    """

    def __init__(
        self, folder: Path, scene: str, info: dict[str, str], queue_size: int = QUEUE_SIZE
    ) -> None:
        self.info = info
        self.queue_size = queue_size
        self.written = 0
        self.dropped = 0
        self.error = ''
        try:
            self.folder = _new_folder(folder, scene)
            self.path = self.folder / f'{self.folder.name}_0.mcap'
            self._stream = open(self.path, 'wb')
        except OSError as error:
            raise InputError(
                f'cannot write a log: {error.strerror}',
                key='record.folder',
                value=str(folder),
                expected='a folder that can be written, or record.enabled false (--no-record)',
            ) from None
        self._queue: deque[tuple[str, type, QoSProfile, int, bytes]] = deque()
        # Each counter has one writer, so the difference needs no lock.
        self._bytes_in = self._bytes_out = 0
        self._channels: dict[str, bag.Channel] = {}
        self._schemas: dict[str, int] = {}
        self._start, self._end = 2**63, 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name='recorder', daemon=True)
        self._thread.start()

    def write(
        self, topic: str, message_type: type, qos: QoSProfile, stamp_ns: int, data: bytes
    ) -> None:
        """Queue one serialised message; `stamp_ns` becomes its log time and publish time."""
        if self.error or self._bytes_in - self._bytes_out + len(data) > self.queue_size:
            self.dropped += 1
            return
        self._bytes_in += len(data)
        self._queue.append((topic, message_type, qos, stamp_ns, data))

    def close(self) -> None:
        """Write what is queued, the summary and metadata.yaml. Further calls do nothing."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            with self._stream:
                self._write_file()
            document = {'rosbag2_bagfile_information': self._metadata()}
            (self.folder / 'metadata.yaml').write_text(
                yaml.safe_dump(document, sort_keys=False, allow_unicode=True), 'utf-8'
            )
        except Exception as error:
            # Nothing that happens to the log, such as a full disk, may stop the simulation: it is
            # reported, and `write` counts what is lost from here on.
            self.error = f'{self.path}: {getattr(error, "strerror", None) or error}'
            self.dropped += len(self._queue)

    def _write_file(self) -> None:
        writer = Writer(self._stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        writer.start(profile='ros2', library='alf_ros')
        writer.add_metadata('alf_ros', self.info)
        self._stream.flush()
        chunk_end = time.monotonic() + CHUNK_PERIOD
        while not self._closing.wait(LOOK_PERIOD):
            self._drain(writer)
            if time.monotonic() >= chunk_end:
                # The writer closes chunks by size only and offers no other way.
                writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
                self._stream.flush()
                chunk_end = time.monotonic() + CHUNK_PERIOD
        self._drain(writer)
        text = yaml.safe_dump(self._metadata(), sort_keys=False, allow_unicode=True)
        writer.add_metadata('rosbag2', {'serialized_metadata': text})
        writer.finish()

    def _drain(self, writer: Writer) -> None:
        while self._queue:
            topic, message_type, qos, stamp_ns, data = self._queue.popleft()
            channel = self._channels.get(topic) or self._register(writer, topic, message_type, qos)
            writer.add_message(channel.id, stamp_ns, data, stamp_ns)
            channel.count += 1
            self.written += 1
            self._bytes_out += len(data)
            self._start, self._end = min(self._start, stamp_ns), max(self._end, stamp_ns)

    def _register(
        self, writer: Writer, topic: str, message_type: type, qos: QoSProfile
    ) -> bag.Channel:
        name, profile = bag.type_name(message_type), bag.qos_text(qos)
        if name not in self._schemas:
            schema = bag.definition(name).encode()
            self._schemas[name] = writer.register_schema(name, 'ros2msg', schema)
        id_ = writer.register_channel(
            topic,
            'cdr',
            self._schemas[name],
            {'offered_qos_profiles': profile, 'topic_type_hash': bag.type_hash(name)},
        )
        channel = self._channels[topic] = bag.Channel(id_, topic, name, profile)
        return channel

    def _metadata(self) -> dict[str, object]:
        start = min(self._start, self._end)
        return bag.metadata(
            self.path.name, list(self._channels.values()), start, self._end, self.info
        )


def _new_folder(parent: Path, scene: str) -> Path:
    """Make `<parent>/<scene>_<UTC time>`, numbered when a log of the same second is there."""
    name = f'{scene}_{datetime.now(timezone.utc):%Y%m%dT%H%M%SZ}'
    parent.mkdir(parents=True, exist_ok=True)
    number = 1
    while True:
        folder = parent / (name if number == 1 else f'{name}_{number}')
        try:
            folder.mkdir()
            return folder
        except FileExistsError:
            number += 1

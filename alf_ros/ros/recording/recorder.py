"""Serialised messages -> an MCAP log that `ros2 bag play` and Foxglove open.

A thread of its own writes: finishing a chunk takes milliseconds that a step does not have.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

from alf_ros.errors import InputError
from alf_ros.ros.recording.mcap_file import LogFile, write_metadata

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

# Seconds of wall time after which a chunk is closed and handed to the system, so that a kill loses
# less than a second; and between two looks into the queue.
CHUNK_PERIOD = 0.5
LOOK_PERIOD = 0.02
QUEUE_SIZE = 64 << 20


@dataclass(frozen=True)
class Split:
    """A file ends when it has so many bytes, or so many simulated seconds; 0: never."""

    size: int = 0
    duration: float = 0.0

    def after(self, file: LogFile, stamp: int) -> bool:
        """Whether a message of this stamp (ns) begins another file."""
        if 0 < self.size <= file.size:
            return True
        return 0.0 < self.duration <= (stamp - file.start) * 1e-9


class Recorder:
    """Writes one run to `<folder>/<scene>_<UTC time>/<the same>_0.mcap`, `…_1.mcap` …

    `info` (str -> str) contains everything needed to repeat the run; it becomes the Metadata
    record `alf_ros` of each file and rosbag2's `custom_data`. `queue_size` (bytes) limits the data
    that wait to be written: further data are dropped and counted, so that `write` never waits for
    the disk. `name` replaces scene and time in the name of the folder made in `folder`.

    Raises `InputError` when the folder cannot be made or written; if it has a `name`, which only
    commands with the option --output give, the message names that option.
    """

    def __init__(
        self,
        folder: Path,
        scene: str,
        info: dict[str, str],
        queue_size: int = QUEUE_SIZE,
        split: Split | None = None,
        name: str = '',
    ) -> None:
        self.info = info
        self.queue_size = queue_size
        self.written = 0
        self.error = ''
        self._split = split or Split()
        try:
            self.folder = _named_folder(folder, name) if name else _new_folder(folder, scene)
            self._file = self._begin(0)
        except OSError as error:
            way_out = 'another one: -o' if name else 'record.enabled false (--no-record)'
            raise InputError(
                f'cannot write a log: {error.strerror}',
                key='--output' if name else 'record.folder',
                value=str(folder),
                expected=f'a folder that can be written, or {way_out}',
            ) from None
        self.busy = 0.0  # s of processor time that writing has taken
        self._finished: list[LogFile] = []
        self._queue: deque[tuple[str, type, QoSProfile, int, bytes, int]] = deque()
        # Each counter has one writer, so the difference needs no lock.
        self._bytes_in = self._bytes_out = 0
        self._queued = self._refused = 0  # messages
        self._numbers: dict[str, int] = {}
        self._noted = 0  # of `dropped`, in the file
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name='recorder', daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        """The file being written."""
        return self._file.path

    @property
    def dropped(self) -> int:
        """Messages that are not in the log: the queue was full, or an `error` of the disk.

        After an error `written` and this add up to all messages given to `write`, and `written` is
        the number in the files.
        """
        return self._refused + (self._queued - self.written if self.error else 0)

    @property
    def taken(self) -> int:
        """Bytes of messages that the writing thread has taken."""
        return self._bytes_out

    @property
    def waiting(self) -> int:
        """Bytes that wait to be written."""
        return self._bytes_in - self._bytes_out

    def write(
        self,
        topic: str,
        kind: type,
        qos: QoSProfile,
        stamp: int,
        data: bytes,
        essential: bool = False,
    ) -> None:
        """Queue one serialised message; `stamp` (ns) becomes its log time and publish time.

        Messages that are `essential` to repeat the run may fill the queue to twice its size. The
        sequence number in the log counts dropped messages too: a gap shows their number and place.
        """
        number = self._numbers[topic] = self._numbers.get(topic, 0) + 1
        room = self.queue_size * (2 if essential else 1)
        if self.error or self.waiting + len(data) > room:
            self._refused += 1
            return
        self._bytes_in += len(data)
        self._queued += 1
        self._queue.append((topic, kind, qos, stamp, data, number))

    def close(self) -> None:
        """Write the queue, the summary and metadata.yaml. Further calls have no effect."""
        self._closing.set()
        self._thread.join()

    def _begin(self, number: int) -> LogFile:
        return LogFile(self.folder / f'{self.folder.name}_{number}.mcap', self.info)

    def _run(self) -> None:
        try:
            self._write_files()
            write_metadata(self.folder, [*self._finished, self._file], self.info)
        except Exception as error:
            # Nothing that happens to the log, such as a full disk, may stop the simulation: it is
            # reported, and `write` counts the messages dropped from here.
            with suppress(OSError):
                self._file.abandon()
            self.written = sum(file.kept for file in (*self._finished, self._file))
            self.error = f'{self.path}: {getattr(error, "strerror", None) or error}'

    def _write_files(self) -> None:
        # The first chunk is closed at once: a log identifies its run, however soon it is killed.
        chunk_end = time.monotonic()
        while not self._closing.wait(LOOK_PERIOD):
            self._drain()
            if time.monotonic() >= chunk_end:
                self._flush()
                chunk_end = time.monotonic() + CHUNK_PERIOD
            self.busy = time.thread_time()
        self._drain()
        self._flush()
        self._file.finish()

    def _flush(self) -> None:
        self._file.flush()
        if self.dropped > self._noted:
            self._noted = self.dropped
            self._file.note('alf_ros_dropped', {'messages': str(self._noted)})

    def _drain(self) -> None:
        while self._queue:
            topic, kind, qos, stamp, data, number = self._queue.popleft()
            if self._split.after(self._file, stamp):
                self._file.finish()
                self._finished.append(self._file)
                self._file = self._begin(len(self._finished))
            self._file.add(topic, kind, qos, stamp, data, number)
            self.written += 1
            self._bytes_out += len(data)


def unused(parent: Path, name: str) -> Path:
    """The folder of this name, for a log. Raises InputError if there is something."""
    folder = parent / name
    if os.path.lexists(folder):
        raise _is_used(folder)
    return folder


def _is_used(folder: Path) -> InputError:
    return InputError(
        'exists already, and is left as it is',
        key='--output',
        value=str(folder),
        expected='another folder: -o',
    )


def _named_folder(parent: Path, name: str) -> Path:
    folder = parent / name
    try:
        folder.mkdir(parents=True)
    except FileExistsError:  # also one that somebody has made since it was looked for
        raise _is_used(folder) from None
    return folder


def _new_folder(parent: Path, scene: str) -> Path:
    """Make `<parent>/<scene>_<UTC time>`, numbered if a log of the same second exists."""
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

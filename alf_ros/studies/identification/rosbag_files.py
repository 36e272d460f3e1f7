"""Recordings of rosbag2 that are no plain MCAP files: SQLite, and what rosbag2 compressed itself.

The package rosbags reads them. Their messages become blocks, as chunks of an MCAP file do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.errors import InputError
from alf_ros.logs import log
from alf_ros.logs.mcap_chunks import Block, Channel, Contents
from alf_ros.scene.text import yaml_document

_SQLITE = '.db3'
_MANY = 4096  # messages of a block


def is_for_rosbags(path: Path) -> bool:
    """Whether a recording is such a one: a file of SQLite, or a folder with such files, or with
    compressed files or messages, which only its metadata.yaml tells apart."""
    if not path.is_dir():
        return path.suffix == _SQLITE
    if any(path.glob('*.mcap')):
        return _compresses_messages(path)
    return any(path.glob(f'*{_SQLITE}')) or (
        any(path.glob(f'*{log.COMPRESSED}')) and (path / 'metadata.yaml').is_file()
    )


def _compresses_messages(folder: Path) -> bool:
    """Whether the metadata.yaml in a folder says so; another one is looked at elsewhere."""
    with suppress(InputError):
        fields = yaml_document.read(folder / 'metadata.yaml').mapping()
        for bag in fields.values():
            mode = bag.mapping().get('compression_mode')
            return mode is not None and mode.text().lower() == 'message'
    return False


def blocks(path: Path, contents: Contents) -> Iterator[Block]:
    """The messages of such a recording, a few thousand at a time; `contents` gets its channels.

    Raises InputError without the package rosbags, and for what it cannot read. Damage further on
    ends the messages, and `contents.damage` says so.
    """
    try:
        from rosbags.rosbag2 import Reader
    except ImportError:
        raise InputError(
            'a recording in SQLite, or compressed by rosbag2',
            file=str(path),
            expected='`pip install rosbags`, or MCAP: `ros2 bag convert` makes it',
        ) from None
    try:
        with Reader(_whole(path)) as reader:
            for number, each in enumerate(reader.connections):
                contents.channels[number] = _channel(number, each)
            yield from _blocks(reader, contents)
    except Exception as error:  # of damaged files rosbags raises what its libraries do
        first = str(error).partition('\n')[0].rstrip('.') or type(error).__name__
        raise InputError(f'cannot be read: {first}', file=str(path)) from None


def _whole(path: Path) -> Path:
    """The only file of a folder without its metadata.yaml; else the folder or file itself."""
    files = list(path.glob(f'*{_SQLITE}')) if path.is_dir() else []
    alone = len(files) == 1 and not (path / 'metadata.yaml').exists()
    return files[0] if alone else path


def _channel(number: int, connection: Any) -> Channel:
    """A topic of a recording. Those from before ROS 2 Iron have no definitions of types: then the
    definition is the one that rosbags knows."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_typestore

    kind, found = connection.msgtype, connection.msgdef
    definition = found.data if found.format == MessageDefinitionFormat.MSG else ''
    if not definition:
        with suppress(KeyError):
            definition = get_typestore(Stores.LATEST).generate_msgdef(kind, ros_version=2)[0]
    encoding = connection.ext.serialization_format
    return Channel(number, connection.topic, encoding, {}, kind, definition)


def _blocks(reader: Any, contents: Contents) -> Iterator[Block]:
    numbers = {id(each): number for number, each in enumerate(reader.connections)}
    counts: Counter[int] = Counter()
    waiting: list[tuple[int, int, int, bytes]] = []  # channel, sequence, stamp, data
    try:
        for connection, stamp, data in reader.messages():
            number = numbers[id(connection)]
            waiting.append((number, counts[number], stamp, bytes(data)))
            counts[number] += 1
            if len(waiting) == _MANY:
                yield _block(waiting)
                waiting.clear()
    except Exception as error:  # as above
        contents.damage = str(error).partition('\n')[0] or type(error).__name__
    if waiting:
        yield _block(waiting)


def _block(messages: list[tuple[int, int, int, bytes]]) -> Block:
    channel, sequence, stamp, data = zip(*messages, strict=True)
    ends = np.cumsum([len(each) for each in data], dtype=np.int64)
    starts = np.concatenate([np.zeros(1, dtype=np.int64), ends[:-1]])
    every = np.frombuffer(b''.join(data), dtype=np.uint8)
    return Block(
        every,
        np.array(channel, dtype=np.int64),
        np.array(sequence, dtype=np.int64),
        np.array(stamp, dtype=np.int64),
        starts,
        ends,
        0,
    )

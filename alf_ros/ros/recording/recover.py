"""A log that was cut off, by a kill or a full disk, as a whole one."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from alf_ros.errors import InputError
from alf_ros.logs.log import Log
from alf_ros.logs.mcap_chunks import Channel, Contents, blocks
from alf_ros.logs.progress import Report, silent
from alf_ros.ros.recording import rosbag2_metadata
from alf_ros.ros.recording.mcap_file import LogFile, write_metadata


def recover(log: Log, folder: Path, report: Report = silent) -> list[LogFile]:
    """Write every whole chunk of a log, with an index and metadata.yaml, into a new folder.

    Raises InputError if that cannot be written, or a topic has two types. An attempt that does not
    come to its end leaves nothing.
    """
    for topic, types in log.survey.types.items():
        if ', ' in types:  # which no metadata.yaml can describe
            expected = 'one type of each topic'
            raise InputError(f'written as {types}', key=topic, expected=expected)
    try:
        folder.mkdir(parents=True)
        try:
            return _copies(log, folder, report)
        except BaseException:  # also Ctrl-C: a part would be taken for all, and be in the way
            shutil.rmtree(folder, ignore_errors=True)
            raise
    except FileExistsError:
        raise InputError('exists already', key='--output', value=str(folder)) from None
    except OSError as error:
        text = f'cannot be written: {error.strerror}'
        raise InputError(text, key='--output', value=str(folder)) from None


def _copies(log: Log, folder: Path, report: Report) -> list[LogFile]:
    """All files of a log in the folder, with their metadata.yaml. Raises OSError."""
    size, before, made = sum(file.stat().st_size for file in log.files), 0, []
    for number, file in enumerate(log.files):
        copy = LogFile(folder / f'{folder.name}_{number}.mcap', log.record)
        made.append(copy)
        for read in _copied(file, copy):
            report((before + read) / size)
        before += file.stat().st_size
    write_metadata(folder, made, log.record)
    return made


def _registered(told: Channel, copy: LogFile) -> rosbag2_metadata.RecordedTopic:
    """The topic of a channel in the copy. Several channels of one topic become one."""
    return copy.channels.get(told.topic) or copy.register(
        told.topic,
        told.type,
        told.definition,
        told.metadata.get('topic_type_hash', ''),
        told.metadata.get('offered_qos_profiles', ''),
    )


def _copied(file: Path, copy: LogFile) -> Iterator[int]:
    """Copy a file message by message; after every chunk, how far it has been read."""
    contents = Contents()
    channels: dict[int, rosbag2_metadata.RecordedTopic] = {}
    for block in blocks(file, contents):
        for k, id_ in enumerate(block.channel.tolist()):
            if id_ not in channels:
                channels[id_] = _registered(contents.channels[id_], copy)
            number = int(block.sequence[k])
            copy.add_to(channels[id_], int(block.stamp[k]), block.message(k), number)
        copy.flush()
        yield block.read
    for name, about in contents.metadata.items():
        if name not in ('alf_ros', 'rosbag2'):
            copy.note(name, about)
    copy.finish()

"""Make a whole log of one that was cut off, by a kill or a full disk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from alf_ros.commands.parser import of_log
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.logs import load
from alf_ros.logs.log import Log
from alf_ros.logs.mcap_chunks import Contents, blocks
from alf_ros.logs.progress import Report, silent
from alf_ros.ros.recording import rosbag2_metadata
from alf_ros.ros.recording.mcap_file import LogFile, write_metadata


def recover(log: Log, folder: Path, report: Report = silent) -> list[LogFile]:
    """Write every whole chunk of a log, with an index and metadata.yaml, into a new folder.

    Raises InputError if that cannot be written.
    """
    try:
        folder.mkdir(parents=True)
        size, before, made = sum(file.stat().st_size for file in log.files), 0, []
        for number, file in enumerate(log.files):
            target = folder / f'{folder.name}_{number}.mcap'
            copy = LogFile(target, log.record)
            made.append(copy)
            for read in _copied(file, copy):
                report((before + read) / size)
            before += file.stat().st_size
        write_metadata(folder, made, log.record)
    except FileExistsError:
        raise InputError('is there already', key='--output', value=str(folder)) from None
    except OSError as error:
        text = f'cannot be written: {error.strerror}'
        raise InputError(text, key='--output', value=str(folder)) from None
    return made


def _copied(file: Path, copy: LogFile) -> Iterator[int]:
    """Copy a file message by message; after every chunk, how far it has been read."""
    contents = Contents()
    channels: dict[int, rosbag2_metadata.Channel] = {}
    for block in blocks(file, contents):
        for k, id_ in enumerate(block.channel.tolist()):
            if id_ not in channels:
                told = contents.channels[id_]
                channels[id_] = copy.register(
                    told.topic,
                    told.type,
                    told.definition,
                    told.metadata.get('topic_type_hash', ''),
                    told.metadata.get('offered_qos_profiles', ''),
                )
            number = int(block.sequence[k])
            copy.add_to(channels[id_], int(block.stamp[k]), block.message(k), number)
        copy.flush()
        yield block.read
    for name, about in contents.metadata.items():
        if name not in ('alf_ros', 'rosbag2'):
            copy.note(name, about)
    copy.finish()


def main(argv: Sequence[str] | None = None) -> int:
    """Recover one log; returns 0. Raises InputError."""
    parser = of_log('recover', 'Make a whole log, with index and metadata.yaml, of one cut off.')
    parser.add_argument(
        '-o', '--output', metavar='OUT', help='folder to make (default: <log>_recovered)'
    )
    options = parser.parse_args(argv)
    log = load(options.log)
    stem = log.path.with_suffix('') if log.path.is_file() else log.path
    folder = Path(options.output or f'{stem}_recovered').expanduser()
    with ProgressBar('recover') as bar:
        made = recover(log, folder, bar)
    count = sum(file.count for file in made)
    end = f', to t = {log.end:.9g} s' if count else ''
    print(f'{folder}: {count} messages{end}')
    print(f'lost: {log.damage}' if log.damage else 'nothing was lost: the log was closed')
    return 0

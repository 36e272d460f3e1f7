"""Make a complete log from a log that was cut off by a kill or a full disk."""

from __future__ import annotations

from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import of_log
from alf_ros.commands.progress import ProgressBar
from alf_ros.logs import load
from alf_ros.ros.recording.recover import recover


def main(argv: Sequence[str] | None = None) -> int:
    """Recover one log; returns 0. Raises InputError."""
    parser = of_log(
        'recover',
        'Make a complete log, with index and metadata.yaml, from a log that was cut off.',
    )
    parser.add_argument(
        '-o', '--output', metavar='OUT', help='folder to create (default: <log>_recovered)'
    )
    options = parser.parse_args(argv)
    log = load(options.log)
    stem = log.path.with_suffix('') if log.path.is_file() else log.path
    folder = paths.named(options.output or f'{stem}_recovered', '--output')
    with ProgressBar('recover') as bar:
        made = recover(log, folder, bar)
    count = sum(file.count for file in made)
    end = f', to t = {log.end:.9g} s' if count else ''
    print(f'{folder}: {count} messages{end}')
    missing = sum(log.survey.lost.values()) - log.survey.dropped
    gaps = f'{missing} messages before its end' if missing > 0 else ''
    lost = [text for text in (log.damage, log.absent, gaps) if text]
    for text in lost:
        print(f'lost: {text}')
    if not lost:
        print('nothing was lost: the log was closed')
    return 0

"""Show logs in one HTML file: motion, plots, inputs, diagnostics. Write logs as tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from alf_ros import paths
from alf_ros.commands.parser import Parser, refuse_given
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.logs import load, tables
from alf_ros.logs.log import Log
from alf_ros.logs.report import animation
from alf_ros.logs.report.html import page, shows_shapes
from alf_ros.logs.report.solid_bodies import HINT, packed_script
from alf_ros.logs.report.summary import Account, account


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page of logs, and tables if asked for; returns 0. Raises InputError."""
    parser = Parser(
        command='analyze',
        description='Write one HTML file that shows logs in a browser, also offline. It contains '
        'the moving mechanism, joints, reactions, energy, constraints, inputs and diagnostics. '
        'The page draws several logs over each other.',
    )
    parser.add_argument(
        'logs', metavar='LOG', nargs='+', help='folder of a log, or one .mcap file'
    )
    parser.add_argument(
        '-o', '--output', metavar='FILE', help='the page (default: beside the first log)'
    )
    parser.add_argument('--csv', metavar='FOLDER', help='also write a CSV table per topic')
    parser.add_argument('--parquet', metavar='FOLDER', help='also write a Parquet table per topic')
    parser.add_argument(
        '--animation',
        metavar='FILE',
        help='also write a moving picture of the logs, side by side: .gif, .webp or .mp4',
    )
    parser.add_argument(
        '--speed',
        metavar='X',
        type=float,
        help='simulated seconds per second of the moving picture (default: 1)',
    )
    options = parser.parse_args(argv)
    speed = 1.0 if options.speed is None else options.speed
    if speed <= 0.0:
        raise InputError(
            'no speed', key='--speed', value=f'{speed:g}', expected='a number above 0'
        )
    if not options.animation:
        refuse_given(options, ('speed',), 'has no meaning without --animation')
    else:
        animation.check_format(paths.named(options.animation, '--animation'))
    logs = [load(path) for path in options.logs]
    target = paths.named(options.output, '--output') if options.output else _beside(logs)
    _refuse_own_files(target, logs)
    accounts = []
    for log in logs:
        with ProgressBar(log.path.name) as bar:
            accounts.append(account(log, bar))
    try:
        paths.put(target, page(accounts))
    except OSError as error:
        raise InputError(f'cannot be written: {error.strerror}', file=str(target)) from None
    print(f'{target}: {target.stat().st_size / 1e6:.1f} MB{_of_solids(accounts)}')
    for made in accounts:
        for fault in made.faults:
            print(f'  {made.name}: {fault}')
    if options.animation:
        _animate(paths.named(options.animation, '--animation'), logs, accounts, speed)
    names = [made.name for made in accounts]
    for folder, write in ((options.csv, tables.to_csv), (options.parquet, tables.to_parquet)):
        if folder is not None:
            for log, below in zip(logs, _folders(paths.named(folder), names), strict=True):
                with ProgressBar(str(below)) as bar:
                    written = write(log, below, bar)
                print(f'{below}: {len(written)} files')
    return 0


def _refuse_own_files(target: Path, logs: Sequence[Log]) -> None:
    """Raises InputError if the page would replace a file of a log."""
    for log in logs:
        own = [*log.files, log.path / 'metadata.yaml']
        if target.resolve() in [file.resolve() for file in own]:
            text = 'a file of the log, and left as it is'
            raise InputError(text, key='--output', value=str(target), expected='a page: .html')


def _of_solids(accounts: Sequence[Account]) -> str:
    """The part of the page that makes bodies solid, or how to get it."""
    if not shows_shapes(accounts):
        return ''
    size = len(packed_script())
    return f', {size / 1e6:.1f} MB of it for solid bodies' if size else f'; {HINT}'


def _animate(path: Path, logs: Sequence[Log], accounts: Sequence[Account], speed: float) -> None:
    """Write the moving picture and say so."""
    titles = animation.titles(accounts, [log.info['solver'] for log in logs])
    films = [animation.film(*pair) for pair in zip(accounts, titles, strict=True)]
    with ProgressBar(path.name) as bar:
        count = animation.write(path, films, speed, bar)
    print(f'{path}: {count} pictures, {path.stat().st_size / 1e6:.1f} MB')


def _folders(folder: Path, names: Sequence[str]) -> list[Path]:
    """Of the tables of each log: of one the folder itself, of several one below it for each."""
    if len(names) == 1:
        return [folder]
    before = [names[:n].count(name) for n, name in enumerate(names)]
    return [
        folder / (f'{name}_{count}' if count else name)
        for name, count in zip(names, before, strict=True)
    ]


def _beside(logs: Sequence[Log]) -> Path:
    """Where the page is put if nobody says: next to the first log, with its name."""
    path = logs[0].path.resolve()
    stem = path.stem if path.is_file() else path.name
    return path.parent / (f'{stem}.html' if len(logs) == 1 else f'{stem}_compared.html')

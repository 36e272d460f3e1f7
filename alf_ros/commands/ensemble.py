"""Run a scene many times with other numbers, in a store that survives, with a report.

See doc/ensembles.md.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from alf_ros import paths
from alf_ros.commands.parser import Parser, refuse_given, writing
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.simulation.quantities import ONE_OF_MANY
from alf_ros.studies.ensemble import report_file
from alf_ros.studies.ensemble.chunk import REASON
from alf_ros.studies.ensemble.ensemble import Progress, conduct, crew
from alf_ros.studies.ensemble.member import trouble_of
from alf_ros.studies.ensemble.store import EnsembleStore
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import load_study
from alf_ros.studies.ensemble.summary_page import page


def main(argv: Sequence[str] | None = None) -> int:
    """Run a study; returns 0, or 1 if a logged member fails, or all of them do. Raises
    InputError, AlfError."""
    parser = Parser(
        command='ensemble',
        description='Run a scene many times, each time with other numbers. The store keeps the '
        'finished members: after an interruption the same command continues.',
    )
    parser.add_argument(
        'study', metavar='STUDY.yaml', help='file of the study: what varies, and what is kept'
    )
    parser.add_argument(
        '--members', type=int, metavar='N', help='number of members (default: as in the study)'
    )
    parser.add_argument(
        '--workers',
        type=int,
        metavar='N',
        help='processes of this machine (default: one for each processor)',
    )
    parser.add_argument(
        '--scheduler',
        metavar='tcp://HOST:PORT',
        help='address of a Dask cluster whose workers run the members',
    )
    parser.add_argument(
        '--store', metavar='FOLDER', help='zarr folder (default: STUDY.zarr in this folder)'
    )
    parser.add_argument(
        '--report',
        metavar='FILE',
        help='file of the report (default: beside the store, as run.html of run.zarr)',
    )
    parser.add_argument(
        '--log',
        type=int,
        metavar='K',
        help='run only member K again, and record it as a log (MCAP)',
    )
    parser.add_argument('-o', '--output', metavar='DIR', help='folder of that log (default: logs)')
    options = parser.parse_args(argv)
    with parser.naming():
        name = paths.named(options.study).stem
        folder = paths.named(options.store or f'{name}.zarr', '--store')
        study = load_study(options.study, members=options.members, store=folder)
    if options.log is not None:
        refuse_given(options, ('report',), 'has no meaning with --log')
        with parser.naming():
            return _log(study, options.log, options.output or 'logs')
    refuse_given(options, ('output',), 'has no meaning without --log')
    if options.scheduler is not None:  # distributed logs tracebacks: here one line says it
        logging.disable(logging.CRITICAL)
    _report(folder, options.report)
    with parser.naming(), _Lines(folder) as lines:
        conduct(study, folder, crew(study, options.workers, options.scheduler, lines.say), lines)
    assert lines.last is not None
    lines.tell()
    report = _report(folder, options.report)  # of the file that is there now
    with parser.naming(), EnsembleStore(folder, study) as store:
        found = page(lines.last, store.finished(), report_file.mark_of(folder))
        written = _write(report, found, options.report, store.is_writable)
        first = next(store.finished()).arrays[REASON.name][0]
    where = f'{folder} and {options.report or report.name}' if written else f'{folder}'
    print(f'{where}: {study.members} members, {lines.last.failed} failed')
    if study.indeterminate:
        print(f'{", ".join(study.indeterminate)}: {ONE_OF_MANY}', file=sys.stderr)
    said = trouble_of(study, 0)
    if said:
        print(f'member 0: {said}', file=sys.stderr)
    if lines.last.failed == study.members:
        print(f'no member has reached its end; the first one: {first}', file=sys.stderr)
        return 1
    return 0


def _report(store: Path, chosen: str | None) -> Path:
    """The file of the report, which may be chosen. Raises InputError."""
    if chosen is None:
        return report_file.beside(store)
    return report_file.elsewhere(paths.named(chosen, '--report'), store)


def _write(report: Path, found: str, chosen: str | None, is_writable: bool) -> bool:
    """Write the report, whole or not at all: a part without its mark would be left as the file of
    somebody else. Beside a store that can only be read there may be no place for it: returns
    whether it is written. Raises InputError otherwise."""
    try:
        with writing('--report' if chosen else '--store', report):
            paths.put(report, found)
    except InputError as error:
        if chosen or is_writable:
            raise
        print(f'no report: {error}; --report FILE writes it elsewhere', file=sys.stderr)
        return False
    return True


def _log(study: Study, k: int, output: str) -> int:
    from alf_ros.ros.recording.member_log import log_member

    try:
        with ProgressBar('ensemble') as bar:
            folder, reason = log_member(study, k, paths.named(output, '--output'), bar)
    except OSError as error:
        raise InputError(str(error), key='--output') from None
    values = ', '.join(f'{name} = {value}' for name, value in study.samples.values(k).items())
    print(f'{folder}: member {k}, {values}')
    if reason:
        print(f'it fails: {reason}')
    return 1 if reason else 0


class _Lines:
    """The progress, on stderr."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._bar = ProgressBar('ensemble')
        self.last: Progress | None = None

    def __enter__(self) -> _Lines:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._bar.clear()
        if kind and issubclass(kind, KeyboardInterrupt) and self.last is not None:
            self._bar.line(
                f'stopped; {self._folder} keeps {self.last.done} of {self.last.members} members, '
                'the same command continues'
            )
            if self.last.done:
                self.tell()

    def __call__(self, progress: Progress) -> None:
        if self.last is None:
            before = f', {progress.kept} finished before' if progress.kept else ''
            self._bar.line(f'{progress.members} members{before}, in {self._folder}')
        self.last = progress
        self._bar.note(
            f'{progress.done}/{progress.members} members, {progress.rate:.3g}/s, '
            f'{progress.left:.0f} s left, {progress.failed} failed{_first(progress)}'
        )

    def say(self, text: str) -> None:
        """Print a line that stays."""
        self._bar.line(text)

    def tell(self) -> None:
        """Print the statistics of each number, of the members that have finished."""
        assert self.last is not None
        statistics = self.last.statistics
        for name, unit in statistics.units.items():
            told = statistics.summary(name)
            if told is None:
                print(f'{name}: of no member')
                continue
            print(
                f'{name}: {told.middle(6, 3)} {unit}'.rstrip()
                + f', median {told.quantiles[2]:.6g}, least {told.least[0]:.6g} (member '
                f'{told.least[1]}), largest {told.largest[0]:.6g} (member {told.largest[1]})'
            )


def _first(progress: Progress) -> str:
    """The first number so far."""
    name = next(iter(progress.statistics.numbers), None)
    told = progress.statistics.summary(name) if name else None
    return f'; {name} {told.middle(4, 2)}' if told else ''

"""Run mechanisms through their singular positions and judge the error against exact motions.

Three errors judge every run: the position error (m) against the equation of the one freedom
(studies/exact), the energy error (J), and the largest constraint violation (m). See
doc/hard_cases.md.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TextIO

from alf_ros import paths
from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.studies.hard_cases import case_plot
from alf_ros.studies.hard_cases.cases import CASES, judge
from alf_ros.studies.hard_cases.table import HEADER, line, measured
from alf_ros.studies.hard_cases.trial import RunResult, TableRow


def main(argv: Sequence[str] | None = None) -> int:
    """Run the cases; returns 0 if all passed, 1 if not. Raises InputError."""
    parser = Parser(
        command='hard_cases',
        description='Run mechanisms through their singular positions and judge the error. '
        'Exit code: 0 if all cases passed, 1 if a case failed, 2 if the request cannot be run.',
    )
    add_folder(parser, 'hard_cases', 'folder for the results')
    parser.add_argument(
        '--quick', action='store_true', help='run a part of the cases, in under a minute'
    )
    parser.add_argument(
        '--case',
        nargs='+',
        default=[],
        metavar='NAME',
        help=f'run these cases only: {", ".join(CASES)}',
    )
    options = parser.parse_args(argv)
    for name in options.case:
        if name not in CASES:
            raise InputError('no such case', key='--case', value=name, choices=CASES)
    chosen = [name for name in CASES if name in options.case or not options.case]
    rows = [row for name in chosen for row in CASES[name](options.quick)]
    with writing_into(options.folder) as folder:
        with (
            paths.replacing(folder / 'hard_cases.csv') as target,
            open(target, 'w', newline='', encoding='utf-8') as stream,
        ):
            results = _run(rows, stream)
        written = ['hard_cases.csv']
        try:
            fixed = [r for done in results for r in done if r.run.tolerance is None]
            if fixed:
                case_plot.draw(folder / 'hard_cases.png', fixed)
                written.append('hard_cases.png')
        except ImportError as error:
            print(f'alf_ros hard_cases: no picture: {error}', file=sys.stderr)
    failed = sum(judge(row, done) != 'passed' for row, done in zip(rows, results, strict=True))
    print(f'{len(rows) - failed} of {len(rows)} passed; {" and ".join(written)} in {folder}')
    return 1 if failed else 0


def _run(rows: Sequence[TableRow], stream: TextIO) -> list[list[RunResult]]:
    """Run the rows and print the line of each when it is done."""
    found = []
    print(HEADER, flush=True)
    with ProgressBar(total=sum(len(row.runs) for row in rows)) as bar:
        for row, results in measured(rows, stream, bar.show):
            bar.clear()
            print(line(row, results), flush=True)
            found.append(results)
    return found

"""Draw the comparison of the paper: ALF1, ALF2 as printed, ALF2 of this package, exact motion.

The figures follow figures 3 to 8 (slider-crank, 6.2) and 10 to 13 (two four-bars, 6.3) of Bayo &
Avello, Nonlinear Dynamics 5 (1994): position, velocity, acceleration, multipliers and energy in 10
s. The command also prints Table I of the paper. The first setting is the setting of the paper, a
variable-step multistep method, which reproduces the finding of the paper. The second setting has
fixed steps. The command writes a CSV file (a line per formulation and instant) and a picture for
each mechanism and setting.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.errors import InputError
from alf_ros.studies.paper import figure_plot, figures, scan, table_one
from alf_ros.studies.paper.figures import Figure
from alf_ros.studies.paper.formulations import EXAMPLES, SPACING, FormulationComparison
from alf_ros.studies.paper.published import INTEGRATORS, PublishedSetting
from alf_ros.studies.paper.scan import LITERAL

SETTINGS = ('paper', 'fixed')


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = Parser(
        command='figures',
        description='Draw the comparison of the paper for the slider-crank and the two four-bars: '
        'ALF1, ALF2 as printed, ALF2 of this package, and the exact motion. Draw it in the '
        'setting of the paper and with fixed steps.',
    )
    setting = PublishedSetting()
    add_folder(parser, 'figures', 'folder for the results')
    parser.add_argument(
        '--tolerance',
        type=float,
        default=setting.tolerance,
        metavar='TOL',
        help='tolerance of one step, in the setting of the paper (default: 1e-5)',
    )
    parser.add_argument(
        '--integrator',
        default=setting.integrator,
        metavar='NAME',
        help='integrator in the setting of the paper: '
        f'{" or ".join(INTEGRATORS)} (default: adams)',
    )
    parser.add_argument(
        '--penalty',
        type=float,
        metavar='ALPHA',
        help='α of every row in the setting of the paper (default: 1e7); `penalty` with fixed '
        'steps (default: 1e8)',
    )
    parser.add_argument(
        '--step',
        type=float,
        default=1e-3,
        metavar='S',
        help='step of rk4, s: 0.02 s divided by a whole number (default: 0.001)',
    )
    parser.add_argument(
        '--setting',
        metavar='NAME',
        help=f'draw one setting only: {" or ".join(SETTINGS)} (default: both)',
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        '--scan',
        action='store_true',
        help='draw nothing; print when the runs fail, for tolerances and penalties around the '
        'values of the paper',
    )
    what.add_argument('--table', action='store_true', help='draw nothing; print Table I')
    options = parser.parse_args(argv)
    steps = SPACING / options.step if options.step > 1e-9 else 0.0
    if not abs(steps - round(steps)) < 1e-6 * steps:
        raise InputError(
            'not a whole number of steps', key='--step', value=options.step, expected='0.02 s / k'
        )
    if not 1e-12 <= options.tolerance <= 0.1:
        raise InputError(
            'not usable', key='--tolerance', value=options.tolerance, expected='1e-12 to 0.1'
        )
    if options.integrator not in INTEGRATORS:
        raise InputError(
            'no such integrator',
            key='--integrator',
            value=options.integrator,
            choices=INTEGRATORS,
        )
    if options.setting not in (None, *SETTINGS):
        raise InputError(
            'no such setting', key='--setting', value=options.setting, choices=SETTINGS
        )
    if options.penalty is not None and not 1.0 <= options.penalty <= 1e15:
        raise InputError(
            'not usable', key='--penalty', value=options.penalty, expected='1 to 1e15'
        )
    return options


def main(argv: Sequence[str] | None = None) -> int:
    """Run, write and draw; returns 0. Raises InputError."""
    options = _options(argv)
    if options.table:
        print(table_one.text())
        return 0
    setting = PublishedSetting(options.tolerance, options.penalty or 1e7, options.integrator)
    comparisons = [FormulationComparison(example) for example in EXAMPLES]
    if options.scan:
        _scan(comparisons, setting)
        return 0
    solver = {'step': options.step, 'penalty': options.penalty or 1e8}
    with writing_into(options.folder) as folder:
        written = []
        if options.setting != 'fixed':
            written += _published(folder, comparisons, setting)
        if options.setting != 'paper':
            print(f'Fixed steps: {figures.fixed_title(solver)}')
            for comparison in comparisons:
                written += _show(folder, figures.fixed(comparison, solver))
    print(f'{", ".join(written)} in {folder}')
    return 0


def _published(
    folder: Path, comparisons: Sequence[FormulationComparison], setting: PublishedSetting
) -> list[str]:
    """Both examples in the setting of the paper, and whether its finding shows."""
    print(f'Setting of the paper: {figures.published_title(setting)}')
    made, written = [], []
    for comparison in comparisons:
        made.append(figures.published(comparison, setting))
        written += _show(folder, made[-1])
    print(f'{figures.SAID}\n{figures.finding(made[-1].runs)}')
    return written


def _show(folder: Path, figure: Figure) -> list[str]:
    """Write, print and draw the runs of an example; returns the names of the files written."""
    written = [f'{figure.name}.csv']
    figure.write(folder / written[0])
    for line in figure.lines():
        print(line)
    try:
        picture = folder / f'{figure.name}.png'
        figure_plot.draw(picture, figure.heading, figure.comparison, list(figure.curves))
        written.append(picture.name)
    except ImportError as error:
        print(f'alf_ros figures: no picture: {error}', file=sys.stderr)
    return written


def _scan(comparisons: Sequence[FormulationComparison], setting: PublishedSetting) -> None:
    print(f'{setting.integrator}; "-": gets through 10 s')
    for comparison in comparisons:
        for name in LITERAL:
            print(f'\n{scan.table(comparison, name, setting)}', flush=True)
    print(f'\nα = {setting.penalty:g}:')
    for comparison in comparisons:
        for name in LITERAL:
            print(scan.neighbours(comparison, name, setting), flush=True)

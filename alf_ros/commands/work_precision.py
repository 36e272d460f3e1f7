"""Measure processor time against error, for every formulation and integrator.

The command sweeps formulations, integrators, steps or tolerances, and iterations. A CSV file keeps
the measurements. A measurement is not repeated while version, machine, scene and duration are the
same. See doc/performance.md.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.logs.provenance import about
from alf_ros.scene.scene import FORMULATIONS, INTEGRATORS, load_scene
from alf_ros.studies.work_precision import report as work_report
from alf_ros.studies.work_precision import work_precision_plot
from alf_ros.studies.work_precision.reference import reference
from alf_ros.studies.work_precision.sweep import Store, plan, sweep

TOLERANCES = tuple(10.0 ** (-k / 2.0) for k in range(6, 25))
ITERATIONS = (1, 2, 10)


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = Parser(
        command='work_precision',
        description='Measure processor time per simulated second against error. The reference is '
        'the exact motion if it is known, otherwise a converged run. If the command was stopped, '
        'run it again to continue.',
    )
    parser.add_argument('scene', nargs='+', metavar='SCENE', help='name or path of a scene')
    add_folder(parser, 'work_precision', 'folder for the results')
    add = parser.add_argument
    add(
        '--duration',
        type=float,
        metavar='S',
        help='simulated time, s (default: 10, or as long as the exact motion)',
    )
    add('--formulation', nargs='+', metavar='NAME', help='use these formulations only')
    add('--integrator', nargs='+', metavar='NAME', help='use these integrators only')
    add(
        '--iterations',
        nargs='+',
        type=int,
        default=ITERATIONS,
        metavar='N',
        help='maximum iterations per solve',
    )
    add('--step', nargs='+', type=float, metavar='S', help='fixed steps, s')
    add(
        '--tolerance',
        nargs='+',
        type=float,
        default=TOLERANCES,
        metavar='R',
        help='tolerances of adaptive integrators',
    )
    options = parser.parse_args(argv)
    for key, known in (('formulation', FORMULATIONS), ('integrator', INTEGRATORS)):
        for name in getattr(options, key) or ():
            if name not in known:
                raise InputError(f'no such {key}', key=f'--{key}', value=name, choices=known)
    if options.duration is not None and not 0.0 < options.duration < math.inf:
        raise InputError('not usable', key='--duration', value=options.duration, expected='s')
    for number in options.step or ():
        if not 1e-12 <= number <= 1e6:
            raise InputError('not usable', key='--step', value=number, expected='s')
    for number in options.tolerance:
        if not 0.0 < number <= 1.0:
            raise InputError('not usable', key='--tolerance', value=number, expected='0 to 1')
    for number in options.iterations:
        if not 1 <= number <= 1000:
            raise InputError('not usable', key='--iterations', value=number, expected='1 to 1000')
    return options


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, write, draw; returns 0. Raises InputError."""
    options = _options(argv)
    scenes = [load_scene(source) for source in options.scene]
    summaries = []
    with writing_into(options.folder) as folder:
        store = Store(folder / 'work_precision.csv')
        for scene in scenes:
            chosen = plan(
                scene,
                options.formulation,
                options.integrator,
                options.iterations,
                options.step,
                options.tolerance,
            )
            if not chosen:
                raise InputError('leaves nothing to measure', key='--integrator')
            against, kept = reference(scene, options.duration), len(store.rows)
            with ProgressBar(total=len(chosen)) as bar:
                summary = sweep(scene, chosen, against, store, bar.show)
            new, total = len(store.rows) - kept, len(chosen)
            print(f'{work_report.sentence(summary)} ({new} of {total} settings measured now)')
            summaries.append(summary)
        report = work_report.markdown(summaries, about())
        paths.put(folder / 'work_precision.md', report)
        try:
            for summary in summaries:
                pictures = [folder / f'{summary.scene}.{kind}' for kind in ('png', 'svg')]
                work_precision_plot.draw(pictures, summary)
        except ImportError as error:
            print(f'alf_ros work_precision: no picture: {error}', file=sys.stderr)
    print(f'work_precision.csv, .md and pictures in {folder}')
    return 0

"""Measure what accuracy costs: processor time against error, for every way of computing a scene.

Formulations, integrators, steps or tolerances, and iterations are swept. What is measured is kept
in a CSV file and not measured again, as long as version, machine, scene and duration are the same.
See doc/performance.md.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from alf_ros.commands.hard_cases import about
from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.commands.progress import ProgressBar
from alf_ros.digest import digest
from alf_ros.errors import InputError
from alf_ros.resources import version
from alf_ros.scene.scene import FORMULATIONS, INTEGRATORS, Scene, load_scene
from alf_ros.studies.work_precision import plot
from alf_ros.studies.work_precision import report as work_report
from alf_ros.studies.work_precision.measurement import Point, Setting, measure, settings
from alf_ros.studies.work_precision.reference import Reference, reference
from alf_ros.studies.work_precision.report import Summary

COLUMNS = (
    'scene,scene_sha256,version,duration_s,formulation,integrator,iterations,step_s,tolerance,cpu_ms_per_s,'
    'repetitions,preparation_s,evaluations_per_s,position_error_m,energy_error_J,'
    'constraint_error_m,constraint_force_error_N,failure,reference,reference_error_m,'
    'reference_force_error_N'
).split(',')
NUMBERS = (COLUMNS[9], *COLUMNS[11:17])  # of a point
KEYS = COLUMNS[:9]  # what is measured; the rest is what came out
TOLERANCES = tuple(10.0 ** (-k / 2.0) for k in range(6, 25))
ITERATIONS = (1, 2, 10)
ONLY_FORMULATIONS = 20  # bodies above which the dense formulations are left out

Row = dict[str, str]


class Store:
    """The CSV file: its rows of this machine, and where new ones go.

    Rows of other machines and versions are dropped, and so is a last line that was cut off.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._about = path, about()
        self.rows: dict[tuple[str, ...], Row] = {}
        try:
            lines = path.read_text(encoding='utf-8').splitlines()
        except FileNotFoundError:
            lines = []
        if lines and _undated(lines[0]) == _undated(self._about):
            for row in csv.DictReader(lines[1:]):
                whole = list(row) == COLUMNS and None not in row.values()
                if whole and row['version'] == identity():
                    self.rows[_key(row)] = row
        with open(path, 'w', newline='', encoding='utf-8') as stream:
            print(self._about, file=stream)
            writer = csv.DictWriter(stream, COLUMNS, lineterminator='\n')
            writer.writeheader()
            writer.writerows(self.rows.values())

    def add(self, row: Row) -> None:
        """Keep a row, in the file at once."""
        self.rows[_key(row)] = row
        with open(self._path, 'a', newline='', encoding='utf-8') as stream:
            csv.DictWriter(stream, COLUMNS, lineterminator='\n').writerow(row)


def identity() -> str:
    """The version of the package, and a digest of the code that computes the motion."""
    code = digest('kernel', 'mechanism', 'model', 'effects', 'scene', 'simulation')
    return f'{version()}+{code[:8]}'


def sweep(scene: Scene, plan: Sequence[Setting], against: Reference, store: Store) -> Summary:
    """Measure what is not in the store yet; returns all points of the plan."""
    points, bar = [], ProgressBar(total=len(plan))
    for setting in plan:
        bar.show(f'{scene.name}: {setting.formulation}, {setting}')
        wanted = _keys(scene, setting, against)
        row = store.rows.get(tuple(wanted.values()))
        if row is None:
            row = wanted | _measured(measure(scene, setting, against), against)
            store.add(row)
        points.append(point_of(row))
    bar.clear()
    stated = against.times[-1], against.kind, against.error, against.force_error
    return Summary(scene.name, *stated, points)


def _keys(scene: Scene, setting: Setting, against: Reference) -> Row:
    tolerance = '' if setting.tolerance is None else f'{setting.tolerance:.6g}'
    numbers = [f'{setting.iterations}', f'{setting.step:.9g}', tolerance]
    head = [scene.name, scene.hash[:16], identity(), f'{against.times[-1]:g}']
    values = [*head, setting.formulation, setting.integrator, *numbers]
    return dict(zip(KEYS, values, strict=True))


def _measured(point: Point, against: Reference) -> Row:
    errors = (point.position, point.energy, point.gap, point.force)
    values = [f'{point.cpu:.5g}', f'{point.repetitions}', f'{point.preparation:.3g}']
    values += [f'{point.evaluations:.5g}', *(f'{error:.4g}' for error in errors), point.failure]
    values += [against.kind, f'{against.error:.2g}', f'{against.force_error:.2g}']
    return dict(zip(COLUMNS[len(KEYS) :], values, strict=True))


def point_of(row: Row) -> Point:
    """The point that a row of the CSV file holds."""
    tolerance = float(row['tolerance']) if row['tolerance'] else None
    setting = Setting(
        row['formulation'],
        row['integrator'],
        int(row['iterations']),
        float(row['step_s']),
        tolerance,
    )
    cpu, preparation, evaluations, *errors = (float(row[name]) for name in NUMBERS)
    position, energy, gap, force = errors
    return Point(
        setting,
        cpu,
        int(row['repetitions']),
        preparation,
        evaluations,
        position,
        energy,
        gap,
        force,
        row['failure'],
    )


def _key(row: Row) -> tuple[str, ...]:
    return tuple(row[name] for name in KEYS)


def _undated(text: str) -> str:
    return text.rpartition(',')[0]


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = Parser(
        prog='work_precision',
        description='Measure what accuracy costs: processor time per simulated second against '
        'errors, relative to the exact motion where it is known, else to a run that converged. '
        'Run it again to go on where it was stopped.',
    )
    parser.add_argument('scene', nargs='+', metavar='SCENE', help='a name or a path')
    add_folder(parser, 'work_precision')
    add = parser.add_argument
    add('--duration', type=float, metavar='S', help='simulated (default: 10, or the exact motion)')
    add('--formulation', nargs='+', metavar='NAME', help='only these')
    add('--integrator', nargs='+', metavar='NAME', help='only these')
    add('--iterations', nargs='+', type=int, default=ITERATIONS, metavar='N')
    add('--step', nargs='+', type=float, metavar='S', help='of fixed steps, s')
    add('--tolerance', nargs='+', type=float, default=TOLERANCES, metavar='R', help='of adaptive')
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


def _plan(scene: Scene, options: argparse.Namespace) -> list[Setting]:
    small = len(scene.mechanism.bodies) <= ONLY_FORMULATIONS
    formulations = options.formulation or (FORMULATIONS if small else FORMULATIONS[:1])
    integrators = options.integrator or INTEGRATORS
    iterations = sorted(options.iterations)
    return list(settings(formulations, integrators, iterations, options.step, options.tolerance))


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, write, draw; returns 0. Raises InputError."""
    options = _options(argv)
    scenes = [load_scene(source) for source in options.scene]
    summaries = []
    with writing_into(options.folder) as folder:
        store = Store(folder / 'work_precision.csv')
        for scene in scenes:
            plan = _plan(scene, options)
            if not plan:
                raise InputError('leaves nothing to measure', key='--integrator')
            against, kept = reference(scene, options.duration), len(store.rows)
            summary = sweep(scene, plan, against, store)
            new = len(store.rows) - kept
            print(f'{work_report.sentence(summary)} ({new} of {len(plan)} settings measured now)')
            summaries.append(summary)
        report = work_report.markdown(summaries, about())
        (folder / 'work_precision.md').write_text(report, encoding='utf-8')
        try:
            for summary in summaries:
                pictures = [folder / f'{summary.scene}.{kind}' for kind in ('png', 'svg')]
                plot.draw(pictures, summary)
        except ImportError as error:
            print(f'alf_ros work_precision: no picture: {error}', file=sys.stderr)
    print(f'work_precision.csv, .md and pictures in {folder}')
    return 0

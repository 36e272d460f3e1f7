"""Run the mechanisms through their singular positions and judge the error against exact motions.

Every run is judged by its position error (m) against the equation of the one freedom (exact.py),
its energy error (J) and the largest gap of a constraint (m). See doc/hard_cases.md.
"""

from __future__ import annotations

import csv
import math
import platform
import statistics
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TextIO

import numpy as np

from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.model.tableaux import TABLEAUX
from alf_ros.studies.exact import motions as reference_motion
from alf_ros.studies.exact.motions import Motion
from alf_ros.studies.hard_cases import campaign, landing, plot
from alf_ros.studies.hard_cases.trial import Result, Row, Run, execute, observed_order

COLUMNS = (
    'case,mechanism,start,integrator,step_s,tolerance,penalty,position_error_m,energy_error_J,constraint_error_m,'
    'position_bound_m,energy_bound_J,evaluations,ratio,verdict'
).split(',')


# ------------------------------------------------------------------------------------------- cases


def _runs(motions: Iterable[Motion], integrator: str, steps: Iterable[float]) -> tuple[Run, ...]:
    """Runs with the bound of the method: 1e-6 m of order 4 (to 2 ms), 1e-9 m of order 8 to 4 ms.

    Above 4 ms order 8 has only to stay on its branch (1e-3 m).
    """

    def bound(h: float) -> float:
        return 1e-6 if integrator == 'rk4' else 1e-9 if h <= 4e-3 else 1e-3

    return tuple(Run(motion, integrator, h, bound(h)) for motion in motions for h in steps)


def _survival(quick: bool) -> Iterator[Row]:
    """All steps h = 0.01/k through the examples of the paper."""
    for name in ('slider_crank', 'double_four_bar'):
        for integrator, numbers in (
            ('rk4', (5, 8, 13, 31) if quick else range(5, 61)),
            ('dop853', (1, 3, 5, 10) if quick else range(1, 61)),
        ):
            steps = [0.01 / k for k in numbers]
            yield Row('survival', name, _runs([reference_motion.paper(name)], integrator, steps))


def _change_points(quick: bool) -> Iterator[Row]:
    """A four-bar without symmetry; odd steps, some of which land on the position."""
    odd = (0.0, 0.13, 0.26, 0.39, 0.52, 0.65)
    steps = [5e-3 / (k + more) for k in ((1, 2) if quick else (1, 2, 5, 10)) for more in odd]
    motion = reference_motion.change_point()
    for integrator, factor, order in (('rk4', 1e6, 4), ('dop853', 1e10, 8)):
        runs = tuple(Run(motion, integrator, h, factor * h**order + 1e-10) for h in steps)
        yield Row('change_point', 'change_point', runs)


def _many_bars(quick: bool) -> Iterator[Row]:
    """N freedoms more for an instant, against the pendulum that N four-bars are."""
    for integrator, steps in (('rk4', (2e-3, 1e-3, 5e-4)), ('dop853', (4e-3, 2e-3, 1e-3))):
        for n in (2, 10) if quick else (2, 10, 100, 1000):
            yield Row(
                'many_bars',
                f'n_four_bar N={n}',
                _runs([reference_motion.four_bars(n)], integrator, steps),
            )


def _starts(quick: bool) -> Iterator[Row]:
    """Let go in the singular position, so near it that rounding decides, at rest beside it."""
    rates = (0.5, -2.0) if quick else (0.5, -0.5, 2.0, -2.0, 6.0, -6.0)
    beside = (1e-3, -1e-7) if quick else (1e-3, -1e-3, 1e-5, -1e-5, 1e-7, -1e-7, 1e-9)
    beyond = (1e-9, -1e-6) if quick else (1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6, 1e-3, -1e-3)
    for name in ('slider_crank', 'double_four_bar'):
        for where, offsets in (('in', (0.0,)), ('near', beyond)):
            motions = [
                reference_motion.start(name, offset, rate) for offset in offsets for rate in rates
            ]
            for integrator, h in (('rk4', 1e-3), ('dop853', 2e-3)):
                yield Row('starts', f'{name} {where} it', _runs(motions, integrator, (h,)))
        at_rest = [reference_motion.start(name, offset, 0.0) for offset in beside]
        for integrator, h in (('rk4', 1e-3), ('dop853', 2e-3)):
            runs = tuple(Run(motion, integrator, h, 1e-6) for motion in at_rest)
            yield Row('starts', f'{name} at rest beside it', runs)


def _orders(quick: bool) -> Iterator[Row]:
    """The order of the method, seen through singular passes; no run may leave its branch."""
    for motion, largest in (
        (reference_motion.paper('slider_crank'), 4e-2),
        (reference_motion.paper('double_four_bar'), 0.12),
        (reference_motion.change_point(), 2.5e-2),
    ):
        for integrator, coarse in (('rk4', 1.6e-2), ('dop853', largest)):
            steps = np.geomspace(coarse, coarse / 5, 9 if quick else 25)
            runs = tuple(Run(motion, integrator, float(h), 0.1) for h in steps)
            yield Row('order', motion.mechanism, runs, TABLEAUX[integrator].order - 0.5)


def _adaptive(quick: bool) -> Iterator[Row]:
    """The error follows the tolerance, and is not above a hundred of it after the motion."""
    tolerances = 10.0 ** -np.arange(3, 13, 3 if quick else 1)
    for motion in (
        reference_motion.paper('slider_crank'),
        reference_motion.paper('double_four_bar'),
        reference_motion.change_point(),
    ):
        runs = tuple(
            Run(motion, 'dop853_adaptive', 1.0, 100.0 * tolerance, tolerance)
            for tolerance in tolerances
        )
        yield Row('adaptive', motion.mechanism, runs)


def _implicit(quick: bool) -> Iterator[Row]:
    """The method for stiff scenes in the same places: its steps, its order, its tolerances."""
    paper = [reference_motion.paper(name) for name in ('slider_crank', 'double_four_bar')]
    steps = [0.01 / k for k in ((1, 3, 8) if quick else range(1, 41))]
    odd = [
        0.01 / (k + more) for k in (1, 2, 5) for more in ((0.13,) if quick else (0.0, 0.13, 0.39))
    ]
    change = reference_motion.change_point()
    for motion, lengths, factor, floor, coarse in (
        (paper[0], steps, 1e4, 2e-9, 1.6e-2),
        (paper[1], steps, 1e4, 2e-9, 4e-2),
        (change, odd, 1e6, 1e-8, 1.6e-2),
    ):
        runs = tuple(Run(motion, 'esdirk43', h, factor * h**4 + floor) for h in lengths)
        yield Row('implicit', motion.mechanism, runs)
        tolerances = 10.0 ** -np.arange(3, 11, 3 if quick else 1)
        runs = tuple(
            Run(motion, 'esdirk43_adaptive', 1.0, 100.0 * tolerance, tolerance)
            for tolerance in tolerances
        )
        yield Row('implicit', motion.mechanism, runs)
        lengths = np.geomspace(coarse, coarse / 5, 9 if quick else 25).tolist()
        runs = tuple(Run(motion, 'esdirk43', h, 0.1) for h in lengths)
        yield Row('implicit', motion.mechanism, runs, TABLEAUX['esdirk43'].order - 0.5)


CASES = {
    'survival': _survival,
    'adaptive': _adaptive,
    'change_point': _change_points,
    'implicit': _implicit,
    'many_bars': _many_bars,
    'starts': _starts,
    'landing': landing.rows,
    'order': _orders,
    'campaign': campaign.rows,
}


# ----------------------------------------------------------------------------------------- running


def _judge(row: Row, results: Sequence[Result]) -> str:
    """'passed', or what is wrong with the runs of a row."""
    bad = [result for result in results if result.verdict != 'passed']
    if bad:
        efforts = list(dict.fromkeys(result.run.effort for result in bad))
        at = ', '.join(efforts[:3]) + (' ...' if efforts[3:] else '')
        lost = sum(bool(result.failure) for result in bad)
        stopped = f', {lost} did not end' if lost else ''
        return f'FAILED: {len(bad)} of {len(results)}{stopped} ({at})'
    if row.order is not None and not observed_order(results) >= row.order:
        return f'FAILED: order below {row.order}'
    if row.ratio is not None and not _ratios(results)[0] <= row.ratio:
        return f'FAILED: more than {row.ratio} times the evaluations'
    return 'passed'


def _ratios(results: Sequence[Result]) -> tuple[float, float]:
    """Median and worst ratio of the evaluations to those of the one freedom alone."""
    ratios = [math.inf if result.failure else result.ratio for result in results]
    return statistics.median(ratios), max(ratios)


HEADER = (
    f'{"case":13}{"setting":50}{"runs":>4}  {"position error, m":20}{"energy, J":>9}'
    f'{"gap, m":>9}{"order":>7}{"evaluations":>13}  verdict\n{"":69}{"median":10}worst'
    f'{"":31}median worst'
)


def _line(row: Row, results: Sequence[Result]) -> str:
    def worst(values: Iterable[float]) -> float:
        return max(values, key=lambda value: (math.isnan(value), value))

    steps = sorted({1e3 * run.h for run in row.runs})
    span = f'{steps[0]:.3g} .. {steps[-1]:.3g} ms' if steps[1:] else f'{steps[0]:.3g} ms'
    if row.runs[0].tolerance is not None:
        ends = dict.fromkeys((row.runs[0].tolerance, row.runs[-1].tolerance))
        span = ' .. '.join(f'{tolerance:.0e}' for tolerance in ends)
    order, ratios = observed_order(results), '-'
    if row.ratio is not None:
        ratios = '{:.2f} {:.2f}'.format(*_ratios(results))
    middle = statistics.median(
        math.inf if result.failure else result.position for result in results
    )
    return (
        f'{row.case:13}{f"{row.setting}, {row.runs[0].integrator}, {span}":50}{len(results):4}  '
        f'{middle:<10.1e}{worst(r.position for r in results):<10.1e}'
        f'{worst(r.energy for r in results):9.1e}{worst(r.constraint for r in results):9.1e}'
        f'{"-" if math.isnan(order) else format(order, ".2f"):>7}{ratios:>13}  '
        f'{_judge(row, results)}'
    )


def about() -> str:
    """The machine and the versions, one comment line."""
    cpu = platform.processor() or platform.machine()
    try:
        names = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
        cpu = next(x.partition(':')[2].strip() for x in names if x.startswith('model name'))
    except (OSError, StopIteration):
        pass  # not Linux, or a processor that has no name there
    libraries = ', '.join(f'{name} {version(name)}' for name in ('numpy', 'scipy', 'numba'))
    python = platform.python_version()
    return f'# {cpu}, Python {python}, {libraries}, {time.strftime("%Y-%m-%d")}'


def _run_all(rows: Sequence[Row], stream: TextIO) -> list[list[Result]]:
    """Run the rows, printing each when it is done and writing each run into the CSV `stream`."""
    print(about(), file=stream)
    writer = csv.writer(stream, lineterminator='\n')
    writer.writerow(COLUMNS)
    bar = ProgressBar(total=sum(len(row.runs) for row in rows))
    print(HEADER, flush=True)
    done = []
    for row in rows:
        results = []
        for run in row.runs:
            bar.show(f'{row.case}: {row.setting} {run.integrator} {run.effort}')
            result = execute(run)
            results.append(result)
            errors = result.position, result.energy, result.constraint
            bounds, motion = (run.bound, result.energy_bound), run.motion
            writer.writerow(
                [row.case, motion.mechanism, motion.start, run.integrator, f'{run.h:.9g}']
                + ['' if x is None else f'{x:.0e}' for x in (run.tolerance, run.penalty)]
                + [f'{number:.3e}' for number in (*errors, *bounds)]
                + [result.evaluations, '' if run.reduced is None else f'{result.ratio:.3f}']
                + [result.verdict]
            )
            stream.flush()
        bar.clear()
        print(_line(row, results), flush=True)
        done.append(results)
    return done


def main(argv: Sequence[str] | None = None) -> int:
    """Run the cases; returns 0 if all passed, 1 if not. Raises InputError."""
    parser = Parser(
        prog='hard_cases',
        description='Run mechanisms through their singular positions and judge the error. '
        'Exit code: 0 if all passed, 1 if one failed, 2 for what cannot be run.',
    )
    add_folder(parser, 'hard_cases', 'for results')
    parser.add_argument('--quick', action='store_true', help='a reduced form, under a minute')
    parser.add_argument(
        '--case', nargs='+', default=[], metavar='NAME', help=f'only these: {", ".join(CASES)}'
    )
    options = parser.parse_args(argv)
    for name in options.case:
        if name not in CASES:
            raise InputError('no such case', key='--case', value=name, choices=CASES)
    chosen = [name for name in CASES if name in options.case or not options.case]
    rows = [row for name in chosen for row in CASES[name](options.quick)]
    with writing_into(options.folder) as folder:
        with open(folder / 'hard_cases.csv', 'w', newline='', encoding='utf-8') as stream:
            results = _run_all(rows, stream)
        written = ['hard_cases.csv']
        try:
            fixed = [r for row in results for r in row if r.run.tolerance is None]
            if fixed:
                plot.draw(folder / 'hard_cases.png', fixed)
                written.append('hard_cases.png')
        except ImportError as error:
            print(f'alf_ros hard_cases: no picture: {error}', file=sys.stderr)
    failed = sum(_judge(row, done) != 'passed' for row, done in zip(rows, results, strict=True))
    print(f'{len(rows) - failed} of {len(rows)} passed; {" and ".join(written)} in {folder}')
    return 1 if failed else 0

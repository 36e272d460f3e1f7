"""Results of the hard cases: a line of text for each row, a line of CSV for each run."""

from __future__ import annotations

import csv
import math
import statistics
from collections.abc import Iterable, Iterator, Sequence
from typing import TextIO

from alf_ros.logs.progress import Announce, silent
from alf_ros.logs.provenance import about
from alf_ros.studies.hard_cases.cases import judge, ratios
from alf_ros.studies.hard_cases.trial import RunResult, TableRow, execute, observed_order

COLUMNS = (
    'case,mechanism,start,integrator,step_s,tolerance,penalty,position_error_m,energy_error_J,constraint_error_m,'
    'position_bound_m,energy_bound_J,evaluations,ratio,verdict'
).split(',')
HEADER = (
    f'{"case":13}{"setting":50}{"runs":>4}  {"position error, m":20}{"energy, J":>9}'
    f'{"gap, m":>9}{"order":>7}{"evaluations":>13}  verdict\n{"":69}{"median":10}worst'
    f'{"":31}median worst'
)


def line(row: TableRow, results: Sequence[RunResult]) -> str:
    """A row of the table, below HEADER."""

    def worst(values: Iterable[float]) -> float:
        return max(values, key=lambda value: (math.isnan(value), value))

    steps = sorted({1e3 * run.h for run in row.runs})
    span = f'{steps[0]:.3g} .. {steps[-1]:.3g} ms' if steps[1:] else f'{steps[0]:.3g} ms'
    if row.runs[0].tolerance is not None:
        ends = dict.fromkeys((row.runs[0].tolerance, row.runs[-1].tolerance))
        span = ' .. '.join(f'{tolerance:.0e}' for tolerance in ends)
    order, counts = observed_order(results), '-'
    if row.ratio is not None:
        counts = '{:.2f} {:.2f}'.format(*ratios(results))
    middle = statistics.median(
        math.inf if result.failure else result.position for result in results
    )
    return (
        f'{row.case:13}{f"{row.setting}, {row.runs[0].integrator}, {span}":50}{len(results):4}  '
        f'{middle:<10.1e}{worst(r.position for r in results):<10.1e}'
        f'{worst(r.energy for r in results):9.1e}{worst(r.constraint for r in results):9.1e}'
        f'{"-" if math.isnan(order) else format(order, ".2f"):>7}{counts:>13}  '
        f'{judge(row, results)}'
    )


def measured(
    rows: Iterable[TableRow], stream: TextIO, announce: Announce = silent
) -> Iterator[tuple[TableRow, list[RunResult]]]:
    """Run the rows; yields each with its results when all of them are there.

    Each run is written into the CSV `stream` when it is done, and told to `announce` before.
    Raises OSError if the stream cannot be written.
    """
    print(about(), file=stream)
    writer = csv.writer(stream, lineterminator='\n')
    writer.writerow(COLUMNS)
    for row in rows:
        results = []
        for run in row.runs:
            announce(f'{row.case}: {row.setting} {run.integrator} {run.effort}')
            results.append(execute(run))
            writer.writerow(_cells(row, results[-1]))
            stream.flush()
        yield row, results


def _cells(row: TableRow, result: RunResult) -> list[object]:
    """A run as a line of CSV, by COLUMNS."""
    run = result.run
    errors = result.position, result.energy, result.constraint
    bounds, motion = (run.bound, result.energy_bound), run.motion
    return [
        *(row.case, motion.mechanism, motion.start, run.integrator, f'{run.h:.9g}'),
        *('' if x is None else f'{x:.0e}' for x in (run.tolerance, run.penalty)),
        *(f'{number:.3e}' for number in (*errors, *bounds)),
        *(result.evaluations, '' if run.reduced is None else f'{result.ratio:.3f}'),
        result.verdict,
    ]

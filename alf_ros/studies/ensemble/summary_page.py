"""The report of an ensemble: one HTML file, nothing is fetched.

For each number a histogram, which varied numbers matter, and the scatter against the three that
matter most; for each history a fan over time; and the members that failed, with their reasons.
"""

from __future__ import annotations

import html
import math
from collections.abc import Iterator
from itertools import islice

import numpy as np

from alf_ros import html_table
from alf_ros.simulation.quantities import ONE_OF_MANY
from alf_ros.studies.ensemble import report_look, svg_charts
from alf_ros.studies.ensemble.chunk import REASON, Arrays, Chunk
from alf_ros.studies.ensemble.ensemble import Progress
from alf_ros.studies.ensemble.kept_outputs import LabelledArray
from alf_ros.studies.ensemble.statistics import QUANTILES, Influence, NumberSummary, Statistics
from alf_ros.studies.ensemble.study import Study

MOST_MEMBERS = 4096  # of which the fans are drawn
_MOST_NUMBERS, _MOST_SCATTERS = 40, 3
_BANDS = 'Line: median. Dark band: half of the members. Light band: nine tenths of them.'


def page(progress: Progress, chunks: Iterator[Chunk], head: str = '') -> str:
    """The text of the file, of a study that has run; `chunks` in their order; `head`: an element
    for its head."""
    statistics = progress.statistics
    study, histories, failures = statistics.study, _Histories(statistics.study), _Failures()
    for chunk in chunks:
        histories.add(chunk)
        failures.add(study, chunk)
    parts = [
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">{head}',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<title>{html.escape(study.name)}</title><style>{report_look.LOOK}</style></head><body>',
        f'<h1>{html.escape(study.name)}: {study.members} members</h1>',
        _about(study, progress),
    ]
    if failures.rows:
        parts.append(f'<h2>{progress.failed} members failed</h2>')
        parts.append(html_table.table(('member', 'reason'), failures.rows, progress.failed))
    for name in islice(statistics.numbers, _MOST_NUMBERS):
        parts += _number(statistics, name)
    if len(statistics.numbers) > _MOST_NUMBERS:
        more = f'{len(statistics.numbers) - _MOST_NUMBERS} more numbers are in the store.'
        parts.append(html_table.paragraph(more))
    parts += histories.drawn()
    return ''.join([*parts, '</body></html>\n'])


def _about(study: Study, progress: Progress) -> str:
    rows = [
        ('varied', f'{", ".join(study.samples.names)} ({study.sampling}, seed {study.seed})'),
        ('a member runs', f'{study.duration:g} s, looked at every {study.period:g} s'),
        ('study', study.digest),
    ]
    if study.indeterminate:
        rows.append(('indeterminate', f'{", ".join(study.indeterminate)}: {ONE_OF_MANY}'))
    if not math.isnan(progress.rate):
        rows.append(('members per second', f'{progress.rate:.3g}'))
    return html_table.pairs(rows)


def _number(statistics: Statistics, name: str) -> Iterator[str]:
    told = statistics.summary(name)
    unit = f', {statistics.units[name]}' if statistics.units[name] else ''
    yield f'<h2>{html.escape(name + unit)}</h2>'
    if told is None:
        yield html_table.paragraph('of no member')
        return
    yield html_table.pairs(_lines(told))
    values = statistics.numbers[name]
    yield svg_charts.histogram(f'{name}{unit}', values[np.isfinite(values)])
    influences = statistics.influences(name)
    title, points = 'rank correlation, magnitude', influences[0].points
    if points:  # fewer than there are, if members failed
        title = f'total Sobol index (first order), of {points} points'
    yield svg_charts.bars(title, [_bar(each) for each in influences])
    for each in influences[:_MOST_SCATTERS]:
        varied = statistics.parameters.get(each.name)
        if varied is not None:
            both = np.isfinite(values) & np.isfinite(varied)
            yield svg_charts.scatter(f'against {each.name}', varied[both], values[both])


def _lines(told: NumberSummary) -> list[tuple[str, str]]:
    shares = zip(QUANTILES, told.quantiles, strict=True)
    return [
        ('mean', f'{told.middle(6, 3)} of {told.count} member{"s"[: told.count - 1]}'),
        ('quantiles', ', '.join(f'{share:.0%}: {value:.6g}' for share, value in shares)),
        ('least', f'{told.least[0]:.9g}, member {told.least[1]}'),
        ('largest', f'{told.largest[0]:.9g}, member {told.largest[1]}'),
    ]


def _bar(each: Influence) -> tuple[str, float, str]:
    if not math.isnan(each.total):
        return each.name, each.total, f'{each.total:.3f} ({each.first:.3f})'
    told = '–' if math.isnan(each.correlation) else f'{each.correlation:+.3f}'
    return (
        each.name,
        abs(each.correlation),
        told,
    )  # texts, and values that are all equal, have none


class _Failures:
    """The first members that failed."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, str]] = []

    def add(self, study: Study, chunk: Chunk) -> None:
        reasons = chunk.arrays[REASON.name]
        for n in np.flatnonzero(reasons != '').tolist():
            if len(self.rows) < html_table.MOST_ROWS:
                self.rows.append((str(study.indices(chunk.number)[n]), str(reasons[n])))


class _Histories:
    """The histories of the first members."""

    def __init__(self, study: Study) -> None:
        self._t = study.times
        self._variables = [v for v in study.variables if v.dims[:1] == ('t',)]
        self._rows: list[Arrays] = []
        self._members = 0

    def add(self, chunk: Chunk) -> None:
        if self._members < MOST_MEMBERS and self._variables:
            self._rows.append({v.name: chunk.arrays[v.name] for v in self._variables})
            self._members += len(chunk.arrays[REASON.name])

    def drawn(self) -> Iterator[str]:
        if self._variables and self._rows:
            yield '<h2>Over time, s</h2>'
            yield html_table.paragraph(_BANDS)
        for variable in self._variables if self._rows else ():
            values = np.concatenate([row[variable.name] for row in self._rows]).astype(float)
            for n, name in enumerate(_names(variable)):
                part = values.reshape(len(values), self._t.size, -1)[:, :, n]
                part = part[np.isfinite(part).all(axis=1)]
                if len(part):
                    unit = f', {variable.unit}' if variable.unit else ''
                    title = f'{name}{unit}: {len(part)} members'
                    yield svg_charts.fan(title, self._t, part)


def _names(variable: LabelledArray) -> list[str]:
    """Of a history, or of each of its components."""
    if len(variable.dims) == 1:
        return [variable.name]
    return [f'{variable.name}.{axis}' for axis in variable.along[variable.dims[1]]]

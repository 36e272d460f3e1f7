"""The report of an identification: one HTML file, nothing is fetched.

The numbers with their intervals, the combinations that the recording determines and those that it
does not, and the residuals over time and as a histogram.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence

import numpy as np

from alf_ros import html_table
from alf_ros.errors import printable
from alf_ros.scene.scene import Scene
from alf_ros.studies.ensemble import report_look, svg_charts
from alf_ros.studies.identification.experiment_design import ExperimentDesign, untold
from alf_ros.studies.identification.first_starts import ANYWHERE, AS_SCENE, AT_REST
from alf_ros.studies.identification.identified import ChannelFit, Identification, rounded

_MOST_CHANNELS = 40
_BEGIN = {AT_REST: 'at rest, as was said', AS_SCENE: 'as the scene does, as was said'}
_ONE = 'A deviation of 1 % says that the combination is known to 1 % of the numbers in it.'
_WHITE = (
    'Durbin-Watson is 2 for white noise. The other two are probabilities, for white noise, of '
    'at least what was found. Below 0.01 the residuals are not white: the model or the noise '
    'differs from what the intervals assume, and they are too narrow.'
)
_FURTHER = (
    'What the recordings and one further motion would tell together, with the estimates as the '
    'true numbers. Least certain: the deviation of the least certain combination, by which the '
    'motions are ordered. Volume: the geometric mean of the deviations of all combinations, which '
    'measures the confidence ellipsoid.'
)


def title_of(scene: Scene) -> str:
    """Of the report, HTML."""
    return html.escape(f'Identification of {scene.name}')


def page(found: Identification, design: ExperimentDesign | None = None) -> str:
    """The text of the file; `design`: of further motions."""
    title = title_of(found.scene)
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<title>{title}</title><style>{report_look.LOOK}</style></head><body>',
        f'<h1>{title}</h1>',
        _about(found),
        '<h2>Numbers</h2>',
        _numbers(found),
        *_knowledge(found),
        *(_design(design) if design is not None else ()),
        *_fit(found),
    ]
    for channel in found.channels[:_MOST_CHANNELS]:
        parts += _channel(channel)
    return ''.join([*parts, '</body></html>\n'])


def _about(found: Identification) -> str:
    rows = [
        ('recordings', ', '.join(each.name for each in found.recordings)),
        ('windows', f'{len(found.windows)} fitted, {len(found.kept_away)} kept away'),
        ('measurements', str(sum(part.size for c in found.channels for part in c.residuals))),
        ('evaluations', str(found.evaluations)),
        ('ended', found.reason if found.settled else f'not settled: {found.reason}'),
    ]
    if found.begins != ANYWHERE:
        rows.append(('recordings begin', _BEGIN[found.begins]))
    if found.trouble:
        rows.append(('not resolved', found.trouble))
    rows += [('inputs', told) for told in found.beside_inputs]
    unused = [name for each in found.recordings for name in each.unused]
    if unused:
        rows.append(('recorded, not used', ', '.join(unused)))
    rows += [('damage', each.damage) for each in found.recordings if each.damage]
    return html_table.pairs(rows)


def _numbers(found: Identification) -> str:
    head = ('number', 'scene', 'estimate', 'deviation', '95 % from', 'to')
    rows = []
    for k, name in enumerate(found.names):
        spread = float(found.deviations[k])
        low, high = (rounded(x, spread) for x in found.intervals[k])
        deviation = f'{spread:.3g}'
        if not np.isfinite(spread):
            low, high, deviation = '', '', 'not determined'
        label = f'{name} (at its bound)' if name in found.at_bounds else name
        value = rounded(found.values[k], spread)
        rows.append((label, f'{found.before[k]:.6g}', value, deviation, low, high))
    return _table(head, rows)


def _knowledge(found: Identification) -> Iterator[str]:
    yield '<h2>How well the recording determines them</h2>'
    yield f'<p>{_ONE}</p>'
    rows = [
        (
            each.text,
            f'{sigma:.3g}',
            f'{each.deviation:.2%}' if each.determined else _undetermined(each.deviation),
        )
        for sigma, each in zip(found.singular_values, found.combinations, strict=True)
    ]
    yield _table(('combination', 'singular value', 'deviation'), rows)
    if len(found.names) > 1:
        yield '<h2>Correlations</h2>'
        head = ('', *(str(k + 1) for k in range(len(found.names))))
        cells = [
            (f'{k + 1} {name}', *(f'{x:.2f}' for x in row))
            for k, (name, row) in enumerate(zip(found.names, found.correlations, strict=True))
        ]
        yield _table(head, cells)


def _design(design: ExperimentDesign) -> Iterator[str]:
    yield '<h2>Further motions</h2>'
    yield f'<p>{_FURTHER}</p>'
    head = ('further motion', 'duration, s', 'least certain', 'volume', 'rank by volume')
    yield _table(head, [*design.rows()])
    yield '<h2>Deviations after a further motion</h2>'
    yield _table(('number', *design.columns), [*design.deviations()])
    left = [(each.name, untold(one)) for each in design.able for one in each.undetermined]
    left += [
        (each.name, f'cannot be used: {each.failure}') for each in design.motions if each.failure
    ]
    if left:
        yield '<h2>What remains</h2>'
        yield _table(('further motion', ''), left)


def _undetermined(deviation: float) -> str:
    return 'not determined' if np.isinf(deviation) else f'not determined ({deviation:.0%})'


def _fit(found: Identification) -> Iterator[str]:
    yield '<h2>Residuals</h2>'
    yield f'<p>{_WHITE}</p>'
    rows = []
    for each in found.channels:
        test = each.whiteness
        held = '' if np.isnan(each.held_out) else f'{each.held_out:.3g}'
        tests = (f'{test.durbin_watson:.2f}', f'{test.ljung_box:.2g}', f'{test.runs:.2g}')
        rms = (f'{each.before:.3g}', f'{each.after:.3g}', held)
        rows.append((f'{each.name}, {_unit(each)}', *rms, *tests))
    head = ('channel', 'before', 'after', 'kept away', 'Durbin-Watson', 'Ljung-Box', 'runs')
    yield _table(head, rows)
    for each in found.channels:
        for doubt in each.doubts:
            yield f'<p>{html.escape(each.name)}: {doubt}.</p>'


def _channel(channel: ChannelFit) -> Iterator[str]:
    t, r = (np.concatenate([np.zeros(0), *parts]) for parts in (channel.times, channel.residuals))
    if t.size:
        every = max(1, -(-t.size // svg_charts.MOST_POINTS))
        yield f'<h2>{html.escape(channel.name)}</h2>'
        name = f'residual, {_unit(channel)}'
        yield svg_charts.scatter(f'{name}, over time, s', t[::every], r[::every])
        yield svg_charts.histogram(name, r)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """With all its rows and whole texts; a narrow window scrolls it."""
    lines = [f'<tr>{"".join(f"<th>{html.escape(each)}</th>" for each in head)}</tr>']
    for row in rows:
        cells = (f'<td>{html.escape(printable(each))}</td>' for each in row)
        lines.append(f'<tr>{"".join(cells)}</tr>')
    return f'<div class="scroll"><table>{"".join(lines)}</table></div>'


def _unit(channel: ChannelFit) -> str:
    return channel.unit + ('/s' if channel.kind == 'velocity' else '')

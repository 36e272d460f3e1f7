"""The report of an optimisation: one HTML file, nothing is fetched.

The objective and the limited numbers before and after, the numbers with their bounds, the path or
the quantity over time, the objective of each design that was tried, and all starts.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence

import numpy as np

from alf_ros.errors import printable
from alf_ros.scene.scene import Scene
from alf_ros.studies.ensemble import report_look
from alf_ros.studies.optimisation import before_after_charts
from alf_ros.studies.optimisation.before_after_charts import Line, chart
from alf_ros.studies.optimisation.design_goal import DesignGoal, DesignLimit
from alf_ros.studies.optimisation.designs import DesignCurve
from alf_ros.studies.optimisation.local_search import OUTSIDE
from alf_ros.studies.optimisation.optimum import Optimum

_LEAST = 1e-18  # of an objective over tries: a logarithm needs one


def title_of(scene: Scene) -> str:
    """Of the report, HTML."""
    return html.escape(f'Optimisation of {scene.name}')


def page(found: Optimum) -> str:
    """The text of the file."""
    title = title_of(found.scene)
    look = report_look.LOOK + before_after_charts.LOOK
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<title>{title}</title><style>{look}</style></head><body>',
        f'<h1>{title}</h1>',
        *(f'<p>{html.escape(printable(note))}</p>' for note in found.notes),
        '<h2>Objective and limits</h2>',
        _goals(found),
        '<h2>Numbers</h2>',
        _numbers(found),
        '<h2>Before and after</h2>',
        '<div class="figures">',
        *_curves(found),
        '</div>',
        '<h2>Search</h2>',
        _search(found),
        '<h2>Starts</h2>',
        _starts(found),
    ]
    return ''.join([*parts, '</body></html>\n'])


def _goals(found: Optimum) -> str:
    rows = [
        (
            f'minimise {found.objective.text}',
            found.objective.unit,
            _shown(found.objective_before),
            _shown(found.objective_after),
            '',
        )
    ]
    limited = zip(found.limits, found.limits_before, found.limits_after, strict=True)
    for limit, before, after in limited:
        at = ', active' if limit.goal.text in found.active else ''
        rows.append(
            (limit.goal.text, limit.goal.unit, _shown(before), _shown(after), _range(limit) + at)
        )
    return _table(('number of the motion', 'unit', 'before', 'after', 'limits'), rows)


def _numbers(found: Optimum) -> str:
    numbers = found.numbers
    rows = [
        (
            name,
            _shown(numbers.before[k]),
            f'{found.values[k]:.6g}',
            f'{numbers.lower[k]:.6g}',
            f'{numbers.upper[k]:.6g}',
            'at its bound' if name in found.active else '',
        )
        for k, name in enumerate(numbers.names)
    ]
    return _table(('number', 'before', 'after', 'least', 'greatest', ''), rows)


def _curves(found: Optimum) -> Iterator[str]:
    goals: list[tuple[DesignGoal, DesignLimit | None]] = [(found.objective, None)]
    goals += [(limit.goal, limit) for limit in found.limits]
    seen = set()
    for k, (goal, limit) in enumerate(goals):
        before = found.curves_before[k] if found.curves_before else None
        after = found.curves_after[k]
        if goal.path is not None:
            yield _path(goal, before, after)
            continue
        assert goal.quantity is not None
        name = goal.quantity.text
        if name not in seen or limit is not None:
            seen.add(name)
            yield _history(goal, limit, before, after)


def _path(goal: DesignGoal, before: DesignCurve | None, after: DesignCurve) -> str:
    assert goal.path is not None and after.met is not None
    wanted = goal.path.places[:, :2]
    lines = [
        Line('off', '', np.array([here, there]))
        for here, there in zip(after.met[:, :2], wanted, strict=True)
    ]
    if before is not None:
        lines.append(Line('before', 'before', before.y[:, :2]))
    lines.append(Line('after', 'after', after.y[:, :2]))
    lines.append(Line('tried', 'compared', after.met[:, :2]))
    lines.append(Line('wanted', 'wanted', wanted))
    return chart(f'Path of {goal.path.point}, m', lines, ('x, m', 'y, m'), is_map=True)


def _history(
    goal: DesignGoal, limit: DesignLimit | None, before: DesignCurve | None, after: DesignCurve
) -> str:
    assert goal.quantity is not None
    lines = [Line('after', 'after', np.column_stack([after.t, after.y]))]
    if before is not None:
        lines.insert(0, Line('before', 'before', np.column_stack([before.t, before.y])))
    if limit is not None and goal.kind in ('max', 'min'):
        ends = after.t[[0, -1]]
        for bound in (limit.least, limit.most):
            if np.isfinite(bound):
                lines.append(Line('limit', 'limit', np.column_stack([ends, [bound, bound]])))
    unit = f', {goal.quantity.unit}' if goal.quantity.unit else ''
    return chart(f'{goal.quantity.text}{unit}', lines, ('t, s', ''))


def _search(found: Optimum) -> str:
    start = found.starts[found.best]
    tried = np.array(start.tried)
    count = np.arange(1, tried.size + 1, dtype=float)
    fine = np.isfinite(tried)
    values = tried[fine]
    is_log = bool((values > 0.0).all() and values.max() > 100.0 * values.min())
    if is_log:
        values = np.log10(np.maximum(values, _LEAST))
    lines = [Line('tried', 'design', np.column_stack([count[fine], values]))]
    return chart(
        f'{found.objective.text} of the designs of start {found.best}',
        lines,
        ('design', ''),
        refused=count[~fine].tolist(),
        is_log=is_log,
    )


def _starts(found: Optimum) -> str:
    rows = []
    for k, each in enumerate(found.starts):
        name = f'{k}, the best' if k == found.best else str(k)
        outside = f'{each.outside:.2g}' if each.outside > OUTSIDE else ''
        how = each.reason if each.settled else f'not settled: {each.reason}'
        if each.end is None:
            how = f'failed: {each.reason}'
        rows.append((name, _shown(each.objective), outside, str(len(each.tried)), how))
    head = ('start', 'objective', 'outside of limits', 'designs', 'ended')
    return f'<div class="reasons">{_table(head, rows)}</div>'


def _range(limit: DesignLimit) -> str:
    low, high = f'{limit.least:.6g}', f'{limit.most:.6g}'
    if np.isinf(limit.least):
        return f'at most {high}'
    return f'at least {low}' if np.isinf(limit.most) else f'{low} to {high}'


def _shown(value: float) -> str:
    return f'{value:.6g}' if np.isfinite(value) else 'none'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """With all its rows and whole texts; a narrow window scrolls it."""
    lines = [f'<tr>{"".join(f"<th>{html.escape(each)}</th>" for each in head)}</tr>']
    for row in rows:
        cells = (f'<td>{html.escape(printable(each))}</td>' for each in row)
        lines.append(f'<tr>{"".join(cells)}</tr>')
    return f'<div class="scroll"><table>{"".join(lines)}</table></div>'

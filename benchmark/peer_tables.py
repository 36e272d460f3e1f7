"""The tables and the picture of other engines, from their results."""

from __future__ import annotations

import math
import statistics
from pathlib import Path
from typing import Any

from results_file import markdown, rows  # sets the path

# isort: split
from alf_ros.studies.work_precision.measurement import Measurement, Setting
from alf_ros.studies.work_precision.report import TARGETS

SURVIVAL = (0.01 / 60, 0.01 / 5)  # s, steps of the sweep
LOST = 1e-2  # m: above it, it is another motion
MECHANISMS = {
    'slider_crank': 'slider-crank',
    'double_four_bar': 'two four-bars',
    'n_four_bar': 'ten four-bars',
}
COLOURS = ('#0072b2', '#56b4e9', '#002d47', '#8c8ccf', '#d55e00', '#009e73', '#cc79a7')


def peer_points() -> tuple[str, dict[str, dict[str, list[Measurement]]]]:
    """By mechanism and engine, the most accurate first."""
    about, found = rows('peers.csv')
    points: dict[str, dict[str, list[Measurement]]] = {}
    for row in found:
        step, tolerance = (float(row[k]) if row[k] else None for k in ('step_s', 'tolerance'))
        error, cpu = (
            float(row[k]) if row[k] else math.nan for k in ('position_error_m', 'cpu_ms_per_s')
        )
        setting = Setting(row['peer'], '', 0, step or 0.1, tolerance)
        nothing = (math.nan,) * 3
        point = Measurement(setting, cpu, 1, 0.0, 0.0, error, *nothing, row['failure'])
        points.setdefault(row['mechanism'], {}).setdefault(row['peer'], []).append(point)
    for engines in points.values():
        for curve in engines.values():
            curve.sort(key=lambda point: point.setting.effort)
    return about, points


def engine_versions() -> list[str]:
    """Names and versions of the engines."""
    _, found = rows('peers.csv')
    return list(dict.fromkeys(row['about'].partition(',')[0] for row in found))


def survived(curve: list[Measurement]) -> list[Measurement]:
    """The runs of the sweep."""
    low, high = (factor * step for factor, step in zip((0.999, 1.001), SURVIVAL, strict=True))
    return [p for p in curve if p.setting.tolerance is None and low < p.setting.step < high]


def lost(point: Measurement) -> bool:
    """Whether a run did not end, or ended on another motion."""
    return bool(point.failure) or not point.position < LOST


def cheapest(curve: list[Measurement], error: float) -> float:
    """Of the runs below an error (m), lucky ones too; infinite if there is none."""
    return min((p.cpu for p in curve if not p.failure and p.position <= error), default=math.inf)


def peers() -> str:
    """Survival and cost of every engine."""
    about, points = peer_points()
    costs = ' | '.join(f'{target:.0e} m' for target in TARGETS)
    parts = [f'{about}; {", ".join(engine_versions())}.\n']
    for mechanism, engines in points.items():
        parts += [
            f'| {MECHANISMS[mechanism]}, 10 s | lost | median error, m | worst, m | {costs} |',
            '|---' * (4 + len(TARGETS)) + '|',
        ]
        for engine, curve in engines.items():
            sweep = survived(curve)
            cells = ['-'] * 3
            if sweep:
                errors = [math.inf if p.failure else p.position for p in sweep]
                cells = [f'{sum(map(lost, sweep))} of {len(sweep)}']
                cells += [f'{x:.0e}' for x in (statistics.median(errors), max(errors))]
            found = [cheapest(curve, target) for target in TARGETS]
            cells += ['-' if math.isinf(cost) else f'{cost:.3g}' for cost in found]
            parts.append(f'| {engine} | {" | ".join(cells)} |')
        parts.append('')
    return '\n'.join(parts)


def engines() -> str:
    """Runs lost and cost of every engine, in a line for each: for the README."""
    about, points = peer_points()
    shown = ('slider_crank', 'double_four_bar')
    columns = [f'{1e0 * target:.0e} m' for target in TARGETS[:2]]
    names = list(dict.fromkeys(engine for name in shown for engine in points[name]))
    body = []
    for engine in names:
        cells = []
        for mechanism in shown:
            curve = points[mechanism].get(engine, [])
            sweep = survived(curve)
            cells.append(f'{sum(map(lost, sweep))} of {len(sweep)}' if sweep else '-')
            costs = [cheapest(curve, target) for target in TARGETS[:2]]
            cells += ['-' if math.isinf(cost) else f'{cost:.3g} ms' for cost in costs]
        body.append([engine, *cells])
    titles = [f'{MECHANISMS[name]}: {each}' for name in shown for each in ('lost', *columns)]
    said = f'{about}; {", ".join(engine_versions())}'
    return markdown(said, ' | '.join(['engine', *titles]), body)


def draw(path: Path) -> None:
    """Above the error of every step of the sweep, below what an error costs."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    about, points = peer_points()
    figure = Figure(figsize=(4.5 * len(points), 9.0), layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(f'10 s through singular positions, {about}', fontsize=10)
    axes: Any = figure.subplots(2, len(points), sharey='row', squeeze=False)
    # of all mechanisms: one may lack an engine
    names = dict.fromkeys(engine for engines in points.values() for engine in engines)
    colours = dict(zip(names, COLOURS, strict=False))
    handles = {}
    for column, (mechanism, engines) in enumerate(points.items()):
        steps, costs = axes[:, column]
        steps.set(title=MECHANISMS[mechanism], xlabel='step, ms')
        costs.set(xlabel='processor time, ms per simulated second')
        for engine, curve in engines.items():
            colour = colours[engine]
            style: Any = {'color': colour, 'marker': 'o', 'markersize': 3.0, 'linewidth': 1.0}
            sweep = survived(curve)
            errors = [math.nan if p.failure else p.position for p in sweep]
            steps.plot([1e3 * p.setting.step for p in sweep], errors, linestyle='', **style)
            bad = [1e3 * p.setting.step for p in sweep if p.failure]
            steps.plot(bad, [40.0] * len(bad), 'x', color=colour)
            ended = [p for p in curve if not p.failure]
            (handles[engine],) = costs.plot(
                [p.cpu for p in ended], [p.position for p in ended], **style
            )
        for panel in (steps, costs):
            panel.set(xscale='log', yscale='log')
            panel.grid(True, color='0.9')
            panel.set_axisbelow(True)
        steps.set_ylim(1e-13, 1e3)
        steps.set_xticks([0.2, 0.5, 1.0, 2.0], labels=['0.2', '0.5', '1', '2'])
        steps.axhline(10.0, color='0.6', linewidth=0.8)
        text = steps.text(0.01, 0.985, 'did not end', va='top', color='0.4')
        text.set_transform(steps.transAxes)
    for panel in axes[:, 0]:
        panel.set(ylabel='largest position error, m')
    figure.legend(handles.values(), handles.keys(), loc='outside lower center', ncols=6)
    figure.savefig(path, dpi=110)

"""Draw errors of trials against the step, one panel for each mechanism."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from alf_ros.paths import replacing
from alf_ros.studies.hard_cases.trial import RunResult

COLOURS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7')  # Okabe & Ito: told apart by all eyes
TICKS = [m * 10.0**e for e in range(-9, 6) for m in (1, 2, 5)]  # ms
LOWEST, HIGHEST, TOP = 1e-15, 1.0, 30.0  # m; runs that did not end stand between HIGHEST and TOP


def draw(path: Path, results: Sequence[RunResult]) -> None:
    """Write the picture: position error (m) against step (ms), bounds, and failures.

    Raises ImportError without matplotlib, OSError if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    mechanisms = list(dict.fromkeys(result.run.motion.mechanism for result in results))
    integrators = list(dict.fromkeys(result.run.integrator for result in results))
    columns = min(2, len(mechanisms))
    rows = math.ceil(len(mechanisms) / columns)
    figure = Figure(figsize=(6.4 * columns, 4.4 * rows + 0.4), layout='constrained')
    FigureCanvasAgg(figure)
    handles = {}
    steps = [1e3 * result.run.h for result in results]
    span = min(steps) / 1.3, max(steps) * 1.3
    for number, mechanism in enumerate(mechanisms):
        axes = figure.add_subplot(rows, columns, number + 1)
        axes.set(title=mechanism, xscale='log', yscale='log', xlim=span, ylim=(LOWEST, TOP))
        axes.set(xlabel='step, ms', ylabel='largest position error, m')
        axes.set_xticks([t for t in TICKS if span[0] <= t <= span[1]])
        axes.set_xticks([], minor=True)
        axes.xaxis.set_major_formatter('{x:g}')
        axes.set_yticks([10.0**e for e in range(-15, 1, 3)])
        axes.text(0.01, 0.99, 'did not end', transform=axes.transAxes, va='top', color='0.4')
        axes.grid(True, which='major', color='0.9')
        axes.set_axisbelow(True)
        axes.axhline(HIGHEST, color='0.6', linewidth=0.8)
        for integrator, colour in zip(integrators, COLOURS, strict=False):
            mine = [
                result
                for result in results
                if (result.run.motion.mechanism, result.run.integrator) == (mechanism, integrator)
            ]
            bounds = sorted({(1e3 * result.run.h, result.run.bound) for result in mine})
            (ticks,) = axes.plot(*_columns(bounds), '_', color=colour, alpha=0.45, markersize=7)
            good = [_place(result) for result in mine if result.verdict == 'passed']
            (dots,) = axes.plot(*_columns(good), 'o', color=colour, markersize=3.5, alpha=0.8)
            bad = [_place(result) for result in mine if result.verdict != 'passed']
            axes.plot(*_columns(bad), 'o', color=colour, markersize=3.5)
            (circles,) = axes.plot(
                *_columns(bad), 'o', color='red', fillstyle='none', markersize=9
            )
            handles[integrator] = dots
            handles[f'bound of {integrator}'] = ticks
    handles['failed'] = circles
    figure.legend(handles.values(), handles.keys(), loc='outside lower center', ncols=9)
    with replacing(path) as target:
        figure.savefig(target, dpi=120)


def _place(result: RunResult) -> tuple[float, float]:
    """Step (ms) and error (m) as drawn."""
    if result.failure:
        return 1e3 * result.run.h, math.sqrt(HIGHEST * TOP)
    return 1e3 * result.run.h, min(max(result.position, LOWEST), HIGHEST)


def _columns(points: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [x for x, _ in points], [y for _, y in points]

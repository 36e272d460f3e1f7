"""Draw motions over time: what they look like, and how far they are off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.paths import replacing
from alf_ros.studies.paper.formulations import ComparedMotion, FormulationComparison

COLOURS = ('0.75', '#d55e00', '#0072b2', '#009e73')  # the exact one, then Okabe & Ito
STYLES = ('-', '-', '--', ':')
FLOOR = 1e-17  # m or J: errors smaller than this stand here


@dataclass(frozen=True)
class _Panel:
    """The quantity drawn of a curve, and the share by which the axis is wider than 98 % of the
    exact curve: a curve that is far off would hide the others. 0: an error, as a logarithm."""

    title: str
    values: Sequence[Floats]  # of each curve
    margin: float = 0.0


def draw(
    path: Path, title: str, comparison: FormulationComparison, curves: Sequence[ComparedMotion]
) -> None:
    """Write the picture; the first curve is the exact one.

    Raises ImportError without matplotlib, OSError if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 15.0))
    # by hand: to find these takes longer than the rest
    figure.subplots_adjust(0.06, 0.065, 0.985, 0.935, wspace=0.14, hspace=0.2)
    FigureCanvasAgg(figure)
    ends = [f'{curve.name} {curve.verdict()}' for curve in curves[1:]]
    lines = f'vertical lines: singular positions; {", ".join(ends)}'
    figure.suptitle(f'{title}\n{lines}', fontsize=12, y=0.985)
    panels = _panels(comparison, curves)
    grid = figure.subplots(len(panels[0]), 2, sharex=True)
    for axes, panel in zip(grid.T.ravel(), [*panels[0], *panels[1]], strict=True):
        axes.set_title(panel.title, fontsize=10, loc='left')
        axes.grid(True, color='0.93')
        for t in comparison.passages:
            axes.axvline(t, color='0.85', linewidth=0.8, zorder=0)
        handles = _fill(axes, panel, curves)
        if panel.margin:
            legend = handles
    for axes in grid[-1]:
        axes.set_xlabel('t, s')
    labels = [curve.name for curve in curves]
    figure.legend(legend, labels, loc='lower center', ncols=4)
    with replacing(path) as target:
        figure.savefig(target, dpi=100)


def _panels(
    comparison: FormulationComparison, curves: Sequence[ComparedMotion]
) -> tuple[Sequence[_Panel], Sequence[_Panel]]:
    """Those on the left, those on the right."""
    example = comparison.example
    after = f'after figs. {example.figures}: '
    weight = example.weight(comparison.theta) if example.weight_text else np.ones(1)
    lam = [curve.lam * np.resize(weight, curve.t.size)[:, None] for curve in curves]
    names = [f'{example.weight_text}λ of {row}, N/m' for row in example.rows]
    wrong = [np.abs(each[:, 0] - lam[0][: len(each), 0]) for each in lam]
    values = (
        _Panel(f'{after}{example.coordinate}, m', [c.position for c in curves], 0.2),
        _Panel(f'{after}its velocity, m/s', [c.velocity for c in curves], 0.2),
        _Panel(f'{after}its acceleration, m/s²', [c.acceleration for c in curves], 0.2),
        _Panel(f'{after}{names[0]}', [each[:, 0] for each in lam], 0.2),
        _Panel(f'{after}{names[1]}', [each[:, 1] for each in lam], 0.2),
    )
    errors = (
        _Panel(f'{after}energy, J', [c.energy for c in curves], 0.2),
        _Panel('error of position, m', [c.position_error for c in curves]),
        _Panel('error of energy, J', [c.energy_error for c in curves]),
        _Panel(f'error of {names[0]}', wrong),
        _Panel('opening of constraints, m', [c.gap for c in curves]),
    )
    return values, errors


def _fill(axes: Any, panel: _Panel, curves: Sequence[ComparedMotion]) -> list[Any]:
    """The lines of a panel."""
    handles = []
    for n, (curve, values) in enumerate(zip(curves, panel.values, strict=True)):
        if panel.margin:
            width = 1.4 if n else 4.0
            handles += axes.plot(curve.t, values, STYLES[n], color=COLOURS[n], linewidth=width)
        elif n:
            axes.semilogy(curve.t, np.maximum(values, FLOOR), color=COLOURS[n], linewidth=1.4)
    if panel.margin:
        low, high = np.percentile(panel.values[0], (1, 99))
        wide = panel.margin * max(high - low, abs(high))
        axes.set_ylim(low - wide, high + wide)
    return handles

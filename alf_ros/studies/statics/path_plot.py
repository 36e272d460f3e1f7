"""Draw a path of equilibria: quantities over the number that changes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.inspection.run_plot import save
from alf_ros.studies.statics.equilibrium_path import EquilibriumPath
from alf_ros.studies.statics.path_events import BRANCH, FLUTTER, TURN
from alf_ros.studies.statics.rest_stability import UNSTABLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe & Ito: told apart by all eyes
_COLOURS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#56b4e9', '#e69f00')
_SHOWN = 2  # panels without names
_MARKERS = {TURN: 'o', BRANCH: 's', FLUTTER: '^'}


def draw(
    path: EquilibriumPath,
    names: Sequence[str],
    others: Sequence[EquilibriumPath],
    file: Path | None,
) -> tuple[Axes, ...]:
    """A panel for each number of the quantities `names`, with the `others` in other colours.

    Raises InputError without matplotlib, for unknown names, and if the file cannot be written.
    """
    try:
        from matplotlib import figure as figures
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError:
        raise InputError("plot needs matplotlib: pip install 'alf_ros[plot]'") from None
    columns = path.columns(*names) if names else _largest(path)
    size = (7.5, 0.7 + 3.4 * len(columns))
    if file is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=size, layout='constrained')
    else:
        figure = figures.Figure(figsize=size, layout='constrained')
        FigureCanvasAgg(figure)
    axes = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    for name, panel in zip(columns, axes, strict=True):
        for n, each in reversed(list(enumerate((path, *others)))):
            _curve(panel, each, each[name], _COLOURS[n % len(_COLOURS)], named=n == 0)
        panel.set_ylabel(f'{name}, {path.unit_of(name)}'.rstrip(', '), parse_math=False)
        panel.grid(True, color='0.92')
    axes[-1].set_xlabel(f'{path.over}, {path.unit}'.rstrip(', '), parse_math=False)
    axes[0].set_title('solid: stable, dashed: unstable', fontsize=9, color='0.35')
    if file is not None:
        save(figure, file)
    return tuple(axes)


def _curve(axes: Axes, path: EquilibriumPath, values: Floats, colour: str, named: bool) -> None:
    """Parts of one stability in their style, and the events."""
    falls = np.array([each == UNSTABLE for each in path.stability])
    dashed = falls[:-1] | falls[1:]  # of each segment; an event itself is neutral
    for style, chosen in (('-', ~dashed), ('--', dashed)):
        starts = np.flatnonzero(chosen & ~np.concatenate([[False], chosen[:-1]]))
        ends = np.flatnonzero(chosen & ~np.concatenate([chosen[1:], [False]])) + 2
        for first, last in zip(starts, ends, strict=True):
            axes.plot(path.values[first:last], values[first:last], style, color=colour, lw=1.6)
    for event in path.events:
        at = path.values[event.index], values[event.index]
        marker = _MARKERS[event.kind]
        axes.plot(*at, marker, color=colour, markerfacecolor='white', markersize=6)
        if named:
            above = 6 if event.kind == TURN else -13  # they may lie side by side
            axes.annotate(
                event.name, at, (6, above), textcoords='offset points', fontsize=8, color='0.2'
            )


def _largest(path: EquilibriumPath) -> dict[str, Floats]:
    """The positions and joint coordinates that change most."""
    kept = {
        name: values
        for name, values in path.columns().items()
        if name.startswith('points.') or name.endswith('.position')
    }
    order = sorted(kept, key=lambda name: -float(np.ptp(kept[name])))
    return {name: kept[name] for name in order[:_SHOWN]}

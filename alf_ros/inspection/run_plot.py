"""Draw quantities of a run over time: a panel for each unit, a line for each number."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.paths import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(
    t: Floats, panels: Mapping[str, Mapping[str, Floats]], file: Path | None
) -> tuple[Axes, ...]:
    """Draw `panels`: by unit, the values (N,) of each label over t (N,) s.

    With `file` the picture is written without a display. Raises InputError without matplotlib, and
    if the file cannot be written.
    """
    try:
        from matplotlib import figure as figures
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError:
        raise InputError("plot needs matplotlib: pip install 'alf_ros[plot]'") from None
    size = (8.0, 0.8 + 2.4 * len(panels))
    if file is None:
        from matplotlib import pyplot

        figure: Figure = pyplot.figure(figsize=size, layout='constrained')
    else:
        figure = figures.Figure(figsize=size, layout='constrained')
        FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for each, (unit, curves) in zip(axes, panels.items(), strict=True):
        for label, values in curves.items():
            each.plot(t, values, label=label)
        each.set_ylabel(unit or 'without unit')
        each.grid(True, color='0.92')
        for text in each.legend(loc='best', fontsize='small').get_texts():
            text.set_parse_math(False)  # a '$' in a name begins no formula
    axes[-1].set_xlabel('t, s')
    if file is not None:
        save(figure, file)
    return tuple(axes)


def save(figure: Figure, file: Path) -> None:
    """Write a picture. Raises InputError for another format, and if it cannot be written."""
    kinds = figure.canvas.get_supported_filetypes()
    if file.suffix.lstrip('.').lower() not in kinds:
        raise InputError(
            'no format of a picture',
            key='file',
            value=os.fspath(file),
            expected='.png, .svg, .pdf',
        )
    try:
        with replacing(file) as target:
            figure.savefig(target, dpi=120)
    except OSError as error:
        raise InputError(f'cannot be written: {error.strerror or error}', file=str(file)) from None

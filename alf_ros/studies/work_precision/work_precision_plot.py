"""Draw a work-precision sweep: what each setting costs, against its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from alf_ros.paths import replacing
from alf_ros.studies.work_precision.measurement import Measurement
from alf_ros.studies.work_precision.report import Curve, Summary, curves

COLOURS = {  # Okabe & Ito, and three more
    'alf2': '#0072b2',
    'alf1': '#d55e00',
    'alf2_as_printed': '#e69f00',
    'canonical': '#cc79a7',
    'penalty': '#7f4fa3',
    'baumgarte': '#009e73',
    'lagrange_canonical': '#56b4e9',
    'independent': '#555555',
}
MARKERS = {
    'rk4': 'o',
    'dop853': 's',
    'dop853_adaptive': 'D',
    'esdirk43': '^',
    'esdirk43_adaptive': 'v',
}
PANELS: tuple[tuple[str, Callable[[Measurement], float]], ...] = (
    ('largest position error, m', lambda point: point.position),
    ('largest energy error, J', lambda point: point.energy),
    ('largest gap of a constraint, m', lambda point: point.gap),
    ('largest error of Φ_qᵀ λ, N', lambda point: point.force),
)
LEAST = 1e-17  # drawn there: nothing
BAND = 30.0  # factor between the largest error and the line of the runs that did not end


def draw(paths: Sequence[Path], summary: Summary) -> None:
    """Write the picture to all `paths`, whose suffixes say how.

    Raises ImportError without matplotlib, OSError if a file cannot be written.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 9.6), layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(
        f'{summary.scene}, {summary.duration:g} s: cost and error '
        f'({summary.reference}, itself good to {summary.error:.0e} m)'
    )
    handles: dict[str, Any] = {}
    found = curves(summary.points)
    for axes, (label, error) in zip(
        figure.subplots(2, 2, sharex=True).ravel(), PANELS, strict=True
    ):
        _panel(axes, label, error, found, handles)
    figure.supxlabel('processor time, ms per simulated second')
    for axes, own in ((figure.axes[0], summary.error), (figure.axes[3], summary.force_error)):
        handles["below the reference's own error"] = axes.axhspan(
            LEAST, own, color='0.93', zorder=0
        )
    figure.legend(handles.values(), handles.keys(), loc='outside right center', fontsize='small')
    with matplotlib.rc_context({'svg.hashsalt': 'alf_ros'}):  # the same points, the same file
        for path in paths:
            undated = {'Date': None} if path.suffix == '.svg' else {}
            with replacing(path) as target:
                figure.savefig(target, dpi=110, metadata=undated)


def _panel(
    axes: Any,
    label: str,
    error: Callable[[Measurement], float],
    found: dict[Curve, list[Measurement]],
    handles: dict[str, Any],
) -> None:
    points = [point for curve in found.values() for point in curve]
    values = [max(error(point), LEAST) for point in points if not point.failure] or [1.0]
    low, high = min(values), max(values)
    top = high * BAND
    most = max(iterations for *_, iterations in found)
    for (formulation, integrator, iterations), curve in found.items():
        colour = COLOURS.get(formulation, '#000000')
        style: dict[str, Any] = {
            'color': colour,
            'marker': MARKERS.get(integrator, 'v'),
            'markersize': 4.5,
            'linewidth': 1.3,
            'linestyle': '-' if formulation == 'alf2' else ':',
            'zorder': 3 if formulation == 'alf2' else 2,
        }
        name = f'{formulation}, {integrator}'
        if iterations != most:
            name += f', {iterations} iteration' + 's' * (iterations > 1)
            style |= {'fillstyle': 'none', 'linestyle': '--', 'linewidth': 0.8}
        ended = [point for point in curve if not point.failure]
        places = [p.cpu for p in ended], [max(error(p), LEAST) for p in ended]
        (handles[name],) = axes.plot(*places, **style)
        lost = [point for point in curve if point.failure and point.cpu == point.cpu]
        axes.plot([p.cpu for p in lost], [top] * len(lost), 'x', color=colour, markersize=6)
    axes.set(xscale='log', yscale='log', ylabel=label, ylim=(low / 5.0, top * BAND))
    axes.axhline(high * BAND**0.5, color='0.6', linewidth=0.8)
    axes.text(0.01, 0.985, 'did not end', transform=axes.transAxes, va='top', color='0.4')
    axes.grid(True, which='major', color='0.9')
    axes.set_axisbelow(True)

"""Draw motions over time: what they look like, and how far they are off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alf_ros.arrays import Floats

COLOURS = ('0.75', '#d55e00', '#0072b2', '#009e73')  # the exact one, then Okabe & Ito
STYLES = ('-', '-', '--', ':')
FLOOR = 1e-17  # m or J: errors smaller than this stand here


@dataclass(frozen=True)
class Curve:
    """A motion at its times; SI. `stopped`: why it ended early, if it did."""

    name: str
    t: Floats  # (times,) s
    position: Floats  # (times,)
    velocity: Floats  # (times,)
    lam: Floats  # (times, 2)
    position_error: Floats  # (times,)
    energy_error: Floats  # (times,)
    gap: Floats  # (times,) largest opening of a constraint
    stopped: str

    def columns(self) -> list[Floats]:
        """All numbers, in the order of the fields."""
        errors = [self.position_error, self.energy_error, self.gap]
        return [self.t, self.position, self.velocity, *self.lam.T, *errors]


@dataclass(frozen=True)
class Picture:
    """What is said of the curves; passages: times (s) of the singular positions."""

    title: str
    coordinate: str
    multipliers: Sequence[str]
    passages: Floats
    weight: Floats  # (times,) on λ, at the times of the exact curve


def draw(path: Path, picture: Picture, curves: Sequence[Curve]) -> None:
    """Write the picture; the first curve is the exact one.

    Raises ImportError without matplotlib, OSError if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 12.5), layout='constrained')
    FigureCanvasAgg(figure)
    stops = [f'{curve.name} stopped: {curve.stopped}' for curve in curves if curve.stopped]
    figure.suptitle('\n'.join([f'{picture.title}; vertical lines: singular positions', *stops]))
    panels = figure.subplots(4, 2, sharex=True)
    values, errors = panels[:, 0], panels[:, 1]
    first, second = picture.multipliers
    names = [f'{picture.coordinate}, m', 'its velocity, m/s', f'{first}, N/m', f'{second}, N/m']
    for axes, name in zip(values, names, strict=True):
        axes.set_title(name, fontsize=10, loc='left')
    for axes, name in zip(errors, ('position, m', 'energy, J', f'{first}, N/m'), strict=False):
        axes.set_title(f'error of {name}', fontsize=10, loc='left')
    errors[3].set_title('opening of constraints, m', fontsize=10, loc='left')
    for axes in panels.ravel():
        axes.grid(True, color='0.93')
        for t in picture.passages:
            axes.axvline(t, color='0.85', linewidth=0.8, zorder=0)
    truth, handles = curves[0], []
    for curve, colour, style in zip(curves, COLOURS, STYLES, strict=True):
        exact = curve is truth
        weight = picture.weight[: curve.t.size, None]
        lam = curve.lam * weight
        width = 4.0 if exact else 1.4
        for axes, shown in zip(values, (curve.position, curve.velocity, *lam.T), strict=True):
            (line,) = axes.plot(curve.t, shown, style, color=colour, linewidth=width)
        handles.append(line)
        if not exact:
            off = np.abs(lam - truth.lam[: curve.t.size] * weight)[:, 0]
            wrong = (curve.position_error, curve.energy_error, off, curve.gap)
            for axes, shown in zip(errors, wrong, strict=True):
                axes.semilogy(curve.t, np.maximum(shown, FLOOR), color=colour, linewidth=1.4)
    for axes, lam in zip(values[2:], (truth.lam * picture.weight[:, None]).T, strict=True):
        low, high = np.percentile(lam, (1, 99))  # one that is far off would hide the rest
        axes.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    for axes in panels[3]:
        axes.set_xlabel('t, s')
    labels = [curve.name for curve in curves]
    figure.legend(handles, labels, loc='outside lower center', ncols=4)
    figure.savefig(path, dpi=100)

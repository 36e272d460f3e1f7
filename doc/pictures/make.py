"""Draw the pictures of README.md and doc/: `.venv/bin/python doc/pictures/make.py`.

passes.png: two mechanisms going through a singular position, and how far a run of 10 s is from the
exact solution (test/data) at a dozen steps. frames.png: what a wrench command means.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use('Agg')

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon
from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

from alf_ros import Sample, Simulation, load_scene
from alf_ros.arrays import Floats

HERE = Path(__file__).resolve().parent
DATA = HERE.parents[1] / 'test' / 'data'
PARTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  # h = 0.01 s / k

INK, PALE, GRID = '#22303c', '#8b98a3', '#e3e8ec'
BLUE, ORANGE, RED, TEAL = '#1f6fb2', '#d9822b', '#c0272d', '#1f9388'
STYLE: Any = {
    'font.family': 'DejaVu Sans',
    'font.size': 10.5,
    'text.color': INK,
    'axes.edgecolor': PALE,
    'axes.labelcolor': INK,
    'axes.titlesize': 11.5,
    'axes.titlelocation': 'left',
    'xtick.color': INK,
    'ytick.color': INK,
}


def exact(data: str) -> Any:
    """The exact solution in `test/data/<data>.json`."""
    return json.loads((DATA / f'{data}.json').read_text('utf-8'))


def error(sample: Sample, wanted: dict[str, Any]) -> float:
    """Largest difference of a coordinate from the exact one, m."""
    if 'q' in wanted:
        found = [*sample.points['A'], sample.points['B'][0]]
        return float(np.abs(np.subtract(found, wanted['q'])).max())
    place = np.array([np.cos(wanted['theta']), np.sin(wanted['theta'])])
    return max(float(np.abs(sample.points[f'B{k}'] - [k, 0] - place).max()) for k in range(3))


def worst_errors(scene: str, data: str) -> list[float]:
    """Largest error of 101 instants in 10 s, m, for each step 0.01/k."""
    samples, loaded = exact(data)['samples'], load_scene(scene)
    found = []
    for k in PARTS:
        run = Simulation(loaded, step=0.01 / k).run(10.0, every=10 * k)
        found.append(max(error(s, w) for s, w in zip(run, samples, strict=True)))
    return found


def strobe(axes: Axes, scene: str, data: str, bars: dict[str, str], reach: float) -> None:
    """Poses from `reach` s before the first singular position (red) to as long after it.

    `bars`: points in a row -> colour of the bars between them. Later poses are stronger, so that
    the direction of the motion is seen.
    """
    passage = exact(data)['singular_passages'][0]['t']
    times = passage + np.linspace(-reach, reach, 17)
    poses = list(Simulation(load_scene(scene)).run(times[-1], at=list(times)))
    for number, pose in enumerate(poses):
        singular = 2 * number == len(poses) - 1
        for names, colour in bars.items():
            points = np.array([pose.points[name] for name in names.split()])
            strength = 0.2 + 0.65 * number / len(poses)
            tone = 1.0 - strength * (1.0 - np.array(to_rgb(colour)))
            shade = to_rgb(RED) if singular else tuple(tone)
            axes.plot(
                *points.T,
                color=shade,
                linewidth=3.2 if singular else 1.7,
                marker='o',
                markersize=6.0 if singular else 3.2,
                markerfacecolor='white' if singular else shade,
                solid_capstyle='round',
                zorder=10 if singular else 2 + number / 100,
            )
    for name, (x, y) in poses[0].points.items():
        if np.array_equal(poses[-1].points[name], (x, y)):  # a pin in the ground
            feet = [(x, y), (x - 0.07, y - 0.13), (x + 0.07, y - 0.13)]
            axes.add_patch(Polygon(feet, facecolor=INK, zorder=11))
            axes.plot(x, y, 'o', markersize=6, color='white', markeredgecolor=INK, zorder=12)
    axes.set_aspect('equal')
    axes.axis('off')


def convergence(axes: Axes) -> None:
    """Error over step, log-log, with the slope of a method of fourth order."""
    steps = 10.0 / np.array(PARTS)
    cases = (
        ('slider_crank', 'slider_crank_6_2', INK, 'o', 'slider-crank, 11 passes'),
        ('double_four_bar', 'n_fourbar_N2', TEAL, 's', 'two four-bars, 10 passes'),
    )
    for scene, data, colour, marker, label in cases:
        errors = worst_errors(scene, data)
        print(
            label,
            *(f'{h:.3g} ms {e:.1e} m' for h, e in zip(steps, errors, strict=True)),
            sep='\n  ',
        )
        axes.loglog(steps, errors, marker=marker, color=colour, linewidth=1.4, label=label)
    guide = np.array([0.8, 8.0])
    axes.loglog(guide, 4e-11 * guide**4, color=PALE, linestyle='--', linewidth=1.2)
    axes.annotate('$h^4$', (3.0, 1.1e-9), color=PALE, fontsize=12)
    axes.xaxis.set_major_locator(FixedLocator([0.2, 0.5, 1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(StrMethodFormatter('{x:g}'))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which='minor', length=0)
    axes.grid(True, which='major', color=GRID, linewidth=0.8)
    axes.spines[['top', 'right']].set_visible(False)
    axes.set_xlabel('step of RK4, ms')
    axes.set_title('largest position error in 10 s against the exact solution, m')
    axes.legend(frameon=False, loc='upper left')


def passes() -> None:
    """Draw passes.png."""
    figure = plt.figure(figsize=(11.5, 5.6), facecolor='white', layout='constrained')
    grid = figure.add_gridspec(2, 2, width_ratios=[1.1, 1.0], height_ratios=[1.0, 1.15])
    top, bottom = (figure.add_subplot(grid[row, 0]) for row in (0, 1))
    strobe(top, 'slider_crank', 'slider_crank_6_2', {'O A': BLUE, 'A B': ORANGE}, 0.385)
    top.axhline(0.0, color=PALE, linewidth=0.8, zorder=0)
    top.set_title('slider-crank: coupler on crank, slider on crank pin')
    cranks = {'A0 B0': BLUE, 'A1 B1': BLUE, 'A2 B2': BLUE}
    strobe(bottom, 'double_four_bar', 'n_fourbar_N2', {**cranks, 'B0 B1 B2': ORANGE}, 0.2)
    bottom.set_title('two four-bars: all bars in a line')
    convergence(figure.add_subplot(grid[:, 1]))
    figure.savefig(HERE / 'passes.png', dpi=150)


def arrow(axes: Axes, tail: Floats, vector: Floats, colour: str, width: float = 2.2) -> None:
    """An arrow from `tail`."""
    style = {'arrowstyle': '-|>', 'color': colour, 'linewidth': width, 'shrinkA': 0, 'shrinkB': 0}
    head, foot = tuple(tail + vector), tuple(tail)
    axes.annotate('', head, foot, arrowprops={**style, 'mutation_scale': 13})


def cross(axes: Axes, at: Floats, turn: Floats, name: str, colour: str) -> None:
    """The axes of a frame."""
    for vector, label in zip(turn.T, 'xy', strict=True):
        arrow(axes, at, 0.38 * vector, colour, 1.4)
        axes.annotate(label, at + 0.47 * vector, color=colour, ha='center', va='center')
    axes.annotate(name, at - 0.14 * turn.sum(axis=1), color=colour, ha='center', va='center')


def frames() -> None:
    """Draw frames.png: a plate, and a force of (1, 0.5) N in each of the three cases."""
    figure, panels = plt.subplots(1, 3, figsize=(11.5, 3.3), layout='constrained')
    turn = np.array([[np.cos(0.55), -np.sin(0.55)], [np.sin(0.55), np.cos(0.55)]])
    corners = turn @ np.array([[0.0, 2.0, 0.6], [0.0, 0.0, 1.6]]) + [[1.3], [0.0]]
    centre, force = corners.mean(axis=1), np.array([0.9, 0.45])
    cases = (
        ('~/wrench/plate, frame_id world', centre, force, True),
        ('~/wrench/plate, frame_id plate', centre, turn @ force, True),
        ('~/wrench/C, frame_id world', corners[:, 2], force, False),
    )
    for axes, (title, at, vector, torque) in zip(panels, cases, strict=True):
        axes.add_patch(Polygon(corners.T, facecolor=GRID, edgecolor=PALE, linewidth=1.5))
        cross(axes, np.array([0.0, 0.0]), np.eye(2), 'world', INK)
        cross(axes, corners[:, 0], turn, 'plate', TEAL)
        axes.plot(*centre, 'o', color=INK, markersize=4)
        axes.plot(*corners, 'o', color='white', markeredgecolor=INK, markersize=6)
        beside = ([-0.17, 0.02], [0.17, 0.0], [0.0, 0.16])
        for name, corner, offset in zip('ABC', corners.T, beside, strict=True):
            axes.annotate(name, corner + offset, ha='center', va='center', color=INK)
        arrow(axes, at, vector, ORANGE, 2.8)
        axes.annotate(
            'force', at + vector, xytext=(4, 2), textcoords='offset points', color=ORANGE
        )
        if torque:
            angles = np.linspace(-0.6, 3.4, 40)
            arc = centre[:, None] + 0.2 * np.array([np.cos(angles), np.sin(angles)])
            axes.plot(*arc[:, :-3], color=BLUE, linewidth=2.0)
            arrow(axes, arc[:, -4], arc[:, -1] - arc[:, -4], BLUE, 2.0)
            axes.annotate('torque', centre + [-0.02, -0.4], color=BLUE, ha='center')
        axes.set_title(title, family='DejaVu Sans Mono', fontsize=10)
        axes.set(xlim=(-0.35, 3.5), ylim=(-0.35, 2.45), aspect='equal')
        axes.axis('off')
    figure.savefig(HERE / 'frames.png', dpi=110)


if __name__ == '__main__':
    with plt.rc_context(STYLE):
        passes()
        frames()

"""Draw the paper's comparison of ALF1, ALF2 as printed, and ALF2 as built, with the exact motion.

After figures 3 to 8 (slider-crank, 6.2) and 10 to 13 (two four-bars, 6.3) of Bayo & Avello,
Nonlinear Dynamics 5 (1994): positions, velocities, multipliers, energy and constraints in 10 s. λ
are those of the accelerations at the state reached, as `Sample` has them, in every formulation.
For each mechanism a CSV file (a line per formulation and instant) and a picture.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from alf_ros import exact, figure_plot
from alf_ros.arrays import Floats
from alf_ros.errors import InputError, StepError
from alf_ros.exact import OneFreedom
from alf_ros.figure_plot import Curve, Picture
from alf_ros.sample import Sample
from alf_ros.scene import load_scene
from alf_ros.simulation import Simulation

FORMULATIONS = ('alf1', 'alf2_literal', 'alf2')
DURATION, SPACING = 10.0, 0.02  # s


@dataclass(frozen=True)
class Example:
    """A mechanism with an exact motion, and what is shown of it.

    shown: place in q of the coordinate; rows: constraints whose λ are shown, times `weight`(θ),
    which vanishes at the singular positions.
    """

    mechanism: str
    section: str
    alone: Callable[[], OneFreedom]
    theta: float
    rate: float
    coordinate: str
    shown: int
    rows: tuple[str, str]
    weight: Callable[[Floats], Floats]
    weight_text: str


EXAMPLES = (
    Example(
        'slider_crank',
        'Slider-crank (6.2)',
        exact.slider_crank,
        math.pi / 4,
        2 * math.sqrt(2),
        'x of B',
        2,
        ('crank_length', 'coupler_length'),
        np.cos,
        '',
    ),
    Example(
        'double_four_bar',
        'Two four-bars (6.3)',
        lambda: exact.four_bars(2),
        math.pi / 2,
        -1.0,
        'x of B0',
        0,
        ('crank0_length', 'crank1_length'),
        np.sin,
        'sin θ · ',
    ),
)


def _truth(example: Example, times: Floats) -> tuple[Curve, Floats, Floats]:
    """The exact motion as a curve, its angles and its q (times, n).

    λ from the equations of the mechanism at the exact q and q̇.
    """
    alone = example.alone()
    theta, rate = alone.course(example.theta, example.rate, times)
    q = np.array([alone.position(angle) for angle in theta])
    qd = np.array([alone.tangent(angle) * w for angle, w in zip(theta, rate, strict=True)])
    sim = Simulation(load_scene(example.mechanism))
    model, state = sim.model, sim.state
    D = model.layout.dimension
    blocks = model.point_block[: model.layout.movable]
    lam = []
    for positions, velocities in zip(q, qd, strict=True):
        state.q.reshape(-1, D)[blocks] = positions.reshape(-1, D)
        state.qd.reshape(-1, D)[blocks] = velocities.reshape(-1, D)
        sim.restore(replace(state))
        lam.append([sim.sample().multipliers[row] for row in example.rows])
    nothing = np.zeros(times.size)
    shown = q[:, example.shown], qd[:, example.shown]
    curve = Curve('exact', times, *shown, np.array(lam), nothing, nothing, nothing, '')
    return curve, theta, q


def _run(example: Example, formulation: str, solver: dict[str, float], wanted: Floats) -> Curve:
    """A run of a formulation against the exact q (times, n); it ends where a step fails."""
    sim = Simulation(load_scene(example.mechanism), formulation=formulation, **solver)  # type: ignore[arg-type]
    samples: list[Sample] = []
    stopped = ''
    try:
        for k in range(len(wanted)):
            if k:
                sim.step(round(SPACING / sim.h))
            samples.append(sim.sample())
    except StepError as error:
        stopped = str(error)
    energy = samples[0].energy
    errors = [np.abs(s.q - q).max() for s, q in zip(samples, wanted, strict=False)]
    return Curve(
        formulation,
        np.array([s.t for s in samples]),
        np.array([s.q[example.shown] for s in samples]),
        np.array([s.qd[example.shown] for s in samples]),
        np.array([[s.multipliers[row] for row in example.rows] for s in samples]),
        np.array(errors),
        np.array([abs(s.energy - energy) for s in samples]),
        np.array([s.diagnostics.position_violation for s in samples]),
        stopped,
    )


def _write(path: Path, example: Example, curves: Sequence[Curve]) -> None:
    columns = ['formulation', 't_s', f'{example.coordinate} m', f'{example.coordinate} m/s']
    columns += [f'lambda {row}' for row in example.rows]
    columns += ['position_error_m', 'energy_error_J', 'constraint_error_m']
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow([column.replace(' ', '_') for column in columns])
        for curve in curves:
            table = np.column_stack(curve.columns())
            for row in table:
                writer.writerow([curve.name, *(f'{number:.12g}' for number in row)])


def _draw(example: Example, folder: Path, solver: dict[str, float]) -> list[str]:
    """Run, write and draw one example; returns the names of the files written."""
    times: Floats = SPACING * np.arange(round(DURATION / SPACING) + 1, dtype=float)
    truth, theta, q = _truth(example, times)
    curves = [truth, *(_run(example, name, solver, q) for name in FORMULATIONS)]
    written = [f'{example.mechanism}.csv']
    _write(folder / written[0], example, curves)
    for curve in curves[1:]:
        last = f'stopped: {curve.stopped}' if curve.stopped else 'ran to its end'
        print(
            f'{example.mechanism:16}{curve.name:14}{curve.position_error.max():.1e} m, '
            f'{curve.energy_error.max():.1e} J, gap {curve.gap.max():.1e} m; {last}'
        )
    weight = example.weight(theta)
    passed = np.flatnonzero(np.diff(np.sign(weight)))
    share = weight[passed] / (weight[passed] - weight[passed + 1])
    picture = Picture(
        title=f'{example.section}; rk4, {1e3 * solver["step"]:g} ms, α = {solver["penalty"]:g}',
        coordinate=example.coordinate,
        multipliers=[f'{example.weight_text}λ of {row}' for row in example.rows],
        passages=times[passed] + share * SPACING,
        weight=weight if example.weight_text else np.ones(times.size),
    )
    try:
        figure_plot.draw(folder / f'{example.mechanism}.png', picture, curves)
        written.append(f'{example.mechanism}.png')
    except ImportError as error:
        print(f'alf_ros figures: no picture: {error}', file=sys.stderr)
    return written


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f'{message} (see --help)')


def main(argv: Sequence[str] | None = None) -> int:
    """Run, write and draw; returns 0. Raises InputError."""
    parser = _Parser(
        prog='figures',
        description='Draw the comparison of the paper: ALF1, ALF2 as printed, ALF2 as built here, '
        'and the exact motion of the slider-crank and the two four-bars.',
    )
    parser.add_argument(
        '--folder', default='figures', metavar='DIR', help='for results (default: figures)'
    )
    parser.add_argument(
        '--step',
        type=float,
        default=1e-3,
        metavar='S',
        help='of rk4; a whole part of 0.02 s (default: 0.001)',
    )
    parser.add_argument(
        '--penalty', type=float, default=1e8, metavar='ALPHA', help='(default: 1e8)'
    )
    options = parser.parse_args(argv)
    steps = SPACING / options.step if options.step > 1e-9 else 0.0
    if not abs(steps - round(steps)) < 1e-6 * steps:
        raise InputError(
            'no whole number of steps', key='--step', value=options.step, expected='0.02 s / k'
        )
    folder = Path(options.folder).expanduser()
    solver = {'step': options.step, 'penalty': options.penalty}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = [name for example in EXAMPLES for name in _draw(example, folder, solver)]
    except OSError as error:
        raise InputError(str(error.strerror), key='--folder', value=str(folder)) from None
    print(f'{", ".join(written)} in {folder}')
    return 0

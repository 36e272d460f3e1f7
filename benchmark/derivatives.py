"""Tangents and gradients: what they cost beside the run alone, and how exact tangents are.

    .venv/bin/python benchmark/derivatives.py [--without-errors]

Cost, in benchmark/results/derivatives.csv, or derivatives_avx2.csv if a register has 4 numbers:
the processor time of a run with one tangent, with all tangents, and of a run that is written down
and taken back, over the time of the run without them, in turns, medians of 21 such ratios; and the
time of reading the scene around a number, which is spent once.
Errors, in derivative_errors.csv: the largest error of the positions of a run of 10 s and 11 or 10
singular passes; the largest error of each tangent beside the variational equation of the one
angle, both in parts of the largest value; and the ratio of these two.
"""

from __future__ import annotations

import argparse
import csv
import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np
from results_file import RESULTS  # sets the path

# isort: split
from alf_ros import Scene, Simulation, load_scene
from alf_ros.kernel.numba_ext.lane_numbers import width
from alf_ros.logs.provenance import about
from alf_ros.scene.overrides import with_changes
from alf_ros.studies.exact.exact_tangents import double_four_bar, slider_crank
from alf_ros.studies.gradients.legs import RunInstant
from alf_ros.studies.gradients.observed_number import observed_number
from alf_ros.studies.gradients.taped_run import TapedRun

EFFECTS = {
    'effects.spring': '{between: [ground, B], at: [[0, -1], ~], stiffness: 1, free_length: 1}',
    'effects.damper': '{between: [ground, A], at: [[1, -1], ~], damping: 0.02}',
    'effects.drag': '{on: coupler, linear: 0.1}',
}
TEN = {
    'slider_crank': (
        'crank.mass',
        'coupler.mass',
        'm',
        'gravity.acceleration.0',
        'gravity.acceleration.1',
        'initial.velocities.B.0',
        'spring.stiffness',
        'spring.free_length',
        'damper.damping',
        'drag.linear',
    ),
    'delta_robot': (
        'g',
        'arm',
        'rod',
        'platform',
        'initial.velocities.C.0',
        'initial.velocities.C.1',
        'hold0.effort',
        'hold1.effort',
        'hold2.effort',
        'gravity.acceleration.0',
    ),
}
IMPLICIT = {'integrator': 'esdirk43', 'step': '1e-3'}
BARS = 50  # four-bars in a row, each link with a mass of its own
COST = RESULTS / ('derivatives.csv' if width() > 4 else 'derivatives_avx2.csv')
ERRORS = RESULTS / 'derivative_errors.csv'
STEPS = tuple(1e-2 / parts for parts in (3.0, 7.0, 9.0, 13.0))  # s, odd ones
TOLERANCES = 10.0 ** -np.arange(4.0, 12.0)


def errors(exact: Any, settings: dict[str, Any]) -> tuple[float, list[float]]:
    """Of positions and of each tangent, in parts of the largest value."""
    sim = Simulation(load_scene(exact.scene), tangents=exact.names, **settings)
    samples = list(sim.run(exact.times[-1], at=exact.times.tolist()))
    q = np.array([each.q for each in samples])
    found = []
    for name, dq in zip(exact.names, exact.dq, strict=True):
        tangent = np.array([each.tangents[name].q for each in samples])
        found.append(float(np.abs(tangent - dq).max() / np.abs(dq).max()))
    return float(np.abs(q - exact.q).max() / np.abs(exact.q).max()), found


def row_of_four_bars() -> tuple[Scene, tuple[str, ...]]:
    """A row of four-bars, and the names of the masses of its links."""
    names = [f'm{k}' for k in range(BARS + 1)] + [f'c{k}' for k in range(1, BARS + 1)]
    points: dict[str, Any] = {}
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}

    def link(name: str, ends: Sequence[str], mass: str) -> None:
        bodies[name] = {'points': ends, 'mass': mass, 'inertia': 'rod'}

    def pin(name: str, between: Sequence[str], at: str) -> None:
        joints[name] = {'type': 'revolute', 'between': between, 'at': at}

    for k in range(BARS + 1):
        points[f'A{k}'] = {'at': [float(k), 0.0], 'fixed': True}
        points[f'B{k}'] = {'at': [float(k), 1.0]}
        link(f'crank{k}', [f'A{k}', f'B{k}'], f'm{k}')
        pin(f'pin{k}', ['ground', f'crank{k}'], f'A{k}')
    for k in range(1, BARS + 1):
        link(f'coupler{k}', [f'B{k - 1}', f'B{k}'], f'c{k}')
        pin(f'left{k}', [f'crank{k - 1}', f'coupler{k}'], f'B{k - 1}')
        pin(f'right{k}', [f'crank{k}', f'coupler{k}'], f'B{k}')
    mechanism = {
        'alf': 1,
        'space': 'planar',
        'parameters': dict.fromkeys(names, 1.0),
        'points': points,
        'bodies': bodies,
        'joints': joints,
    }
    scene = {
        'mechanism': mechanism,
        'effects': {'gravity': {'acceleration': [0, -9.81]}},
        'initial': {'velocities': {'B0': [1.0, 0.0]}},
        'solver': {'step': 1e-3, 'integrator': 'rk4', 'penalty': 1e10},
    }
    return load_scene(scene), tuple(names)


def cases() -> Mapping[str, tuple[Scene, tuple[str, ...], str, int]]:
    """Of each scene the numbers, the observed number and the steps."""
    crank = with_changes(load_scene('slider_crank'), EFFECTS)
    row, masses = row_of_four_bars()
    delta = load_scene('delta_robot')
    changes = {f'solver.{key}': value for key, value in IMPLICIT.items()}
    stiff, stiff_row = with_changes(delta, changes), with_changes(row, changes)
    method = IMPLICIT['integrator']
    of_crank = crank, TEN['slider_crank'], 'points.B.x'
    return {
        'slider_crank, spring, damper, drag, 10 s': (*of_crank, 10_000),
        'the same, 0.4 s with a singular pass': (*of_crank, 400),
        'the same, 0.35 s, before that': (*of_crank, 350),
        'delta_robot': (delta, TEN['delta_robot'], 'points.C.x', 400),
        f'delta_robot, {method}': (stiff, TEN['delta_robot'], 'points.C.x', 40),
        f'{BARS} four-bars': (row, masses, 'points.B0.x', 200),
        f'{BARS} four-bars, {method}': (stiff_row, masses, 'points.B0.x', 20),
    }


def seconds(call: Callable[[], object]) -> float:
    """Processor time of a call."""
    started = time.thread_time()
    call()
    return time.thread_time() - started


def cost(scene: Scene, names: tuple[str, ...], of: str, steps: int) -> tuple[float, ...]:
    """s of a run alone; over it runs with one and with all tangents, and a run and its way back; s
    of reading."""
    alone, followed = Simulation(scene), Simulation(scene, tangents=names)
    one = Simulation(scene, tangents=names[:1])
    reading = seconds(lambda: Simulation(scene, tangents=names)) / len(names)

    def back() -> None:
        list(run.go_on(steps))
        run.derivatives(number, {RunInstant(steps): 1.0})

    run = TapedRun(Simulation(scene), names)
    number = observed_number(of, 'of', alone.sample(), run.displaced)
    found = []
    for turn in range(22):
        for each in (alone, one, followed):
            each.reset()
        run.restart()
        times = [seconds(partial(each.step, steps)) for each in (alone, one, followed)]
        times.append(seconds(back))
        if turn > 0:  # the first one compiles
            found.append(times)
    ratios = zip(*([each / times[0] for each in times[1:]] for times in found), strict=True)
    return median(times[0] for times in found) / steps, *map(median, ratios), reading


def print_cost() -> None:
    """Print and store what they cost."""
    body = []
    for name, (scene, names, of, steps) in cases().items():
        step, *ratios, reading = cost(scene, names, of, steps)
        shown = (f'{x:.3g}' for x in (1e6 * step, *ratios, 1e3 * reading))
        body.append((name, len(names), *shown))
        print(*body[-1], sep=', ', flush=True)
    write(COST, 'scene,numbers,step_us,one,tangents,gradient,reading_ms', body)


def write(path: Path, columns: str, body: Sequence[Sequence[object]]) -> None:
    """A file of results."""
    with path.open('w', encoding='utf-8') as stream:
        stream.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}\n')
        csv.writer(stream, lineterminator='\n').writerows([columns.split(','), *body])


def print_errors() -> None:
    """Print and store the errors at odd steps and at tolerances."""
    settings: list[tuple[str, dict[str, Any]]] = [
        (f'rk4, {1e3 * h:.3g} ms', {'step': h}) for h in STEPS
    ]
    adaptive = {'step': 0.1, 'integrator': 'dop853_adaptive'}
    settings += [(f'tolerance {t:.0e}', {**adaptive, 'tolerance': float(t)}) for t in TOLERANCES]
    body = []
    for solution in (slider_crank, double_four_bar):
        exact = solution(10.0)
        for label, each in settings:
            position, tangents = errors(exact, each)
            worst = max(tangents)
            name = exact.names[tangents.index(worst)]
            ratio = f'{worst / position:.0f}'
            body.append((exact.scene, label, f'{position:.1e}', f'{worst:.1e}', name, ratio))
            print(*body[-1], sep=', ', flush=True)
    write(ERRORS, 'scene,settings,position,tangent,number,ratio', body)


def main() -> None:
    """Print and store both."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--without-errors', action='store_true', help='only the cost')
    given = parser.parse_args()
    print_cost()
    if not given.without_errors:
        print_errors()


if __name__ == '__main__':
    main()

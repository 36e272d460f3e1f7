"""Tangents: what they cost beside the run alone, and how exact they are.

    .venv/bin/python benchmark/tangents.py [--without-errors]

Cost: the time of a step with tangents over the time of a step without them, in one process, the
least of five measurements of each. Errors: the largest error of the positions of a run of 10 s and
11 or 10 singular passes, and the largest error of each tangent beside the variational equation of
the one angle, both in parts of the largest value; and the ratio of these two.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.scene.overrides import with_changes  # noqa: E402
from alf_ros.studies.exact.exact_tangents import double_four_bar, slider_crank  # noqa: E402

EFFECTS = {
    'effects.spring': '{between: [A, O], at: [~, ~], stiffness: 30, free_length: 0.7}',
    'effects.damper': '{between: [A, B], damping: 0.1}',
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
STEPS = tuple(1e-2 / parts for parts in (3.0, 7.0, 9.0, 13.0))  # s, odd ones
TOLERANCES = 10.0 ** -np.arange(4.0, 12.0)


def step_times(name: str, names: Sequence[str], steps: int) -> tuple[float, float]:
    """µs of a step without and with tangents, the least of seven measurements side by side."""
    scene = load_scene(name)
    if name == 'slider_crank':
        scene = with_changes(scene, EFFECTS)
    both = [Simulation(scene, tangents=each) for each in ((), names)]
    times: list[list[float]] = [[], []]
    for sim in both:
        sim.step(20)
    for _ in range(7):
        for sim, found in zip(both, times, strict=True):
            started = time.perf_counter()
            sim.step(steps)
            found.append((time.perf_counter() - started) / steps * 1e6)
    return min(times[0]), min(times[1])


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


def print_cost() -> None:
    """The ratio of the times of a step."""
    print('scene            tangents   step, µs   with them, µs   ratio')
    for name, names in TEN.items():
        for count in (1, len(names)):
            alone, followed = step_times(name, names[:count], 40)
            ratio = followed / alone
            print(f'{name:16s} {count:8d} {alone:10.1f} {followed:15.1f} {ratio:7.2f}')


def print_errors() -> None:
    """Of positions and tangents, at odd steps and at tolerances."""
    settings: list[tuple[str, dict[str, Any]]] = [
        (f'rk4, h = {h:.3e} s', {'step': h}) for h in STEPS
    ]
    adaptive = {'step': 0.1, 'integrator': 'dop853_adaptive'}
    settings += [(f'tolerance {t:.0e}', {**adaptive, 'tolerance': float(t)}) for t in TOLERANCES]
    for solution in (slider_crank, double_four_bar):
        exact = solution(10.0)
        print(f'\n{exact.scene}: relative errors over 10 s')
        print(
            f'{"":22s} position ',
            *(f'{name[-14:]:>14s}' for name in exact.names),
        )
        for label, each in settings:
            position, tangents = errors(exact, each)
            shown = ' '.join(f'{error:14.1e}' for error in tangents)
            print(f'{label:22s} {position:8.1e}  {shown}   ratio {max(tangents) / position:.0f}')


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--without-errors', action='store_true', help='only the cost')
    given = parser.parse_args()
    print_cost()
    if not given.without_errors:
        print_errors()


if __name__ == '__main__':
    main()

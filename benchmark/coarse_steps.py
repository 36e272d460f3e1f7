"""Whether fixed steps that are too long are reported, over the library.

    .venv/bin/python benchmark/coarse_steps.py [--runs 2000] [--seed 1]

Each run takes a random scene, a random step between 1 ms and 0.3 s and 3 to 300 of them, with each
integrator of fixed steps. Positions are compared with a run of `dop853_adaptive` at a tolerance of
1e-11, in parts of the size. A run that fails counts as reported. Prints for each integrator how
many runs were off, how many of these were silent, and how many were reported although they were
off by less than 1e-4. Writes benchmark/results/coarse_steps.csv.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, StepError, load_scene  # noqa: E402
from alf_ros.arrays import Floats  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.scene.scene import Scene  # noqa: E402

INTEGRATORS = ('rk4', 'dop853', 'esdirk43')
SCENES = sorted(path.stem for path in (ROOT / 'config' / 'scenes').glob('*.yaml'))
OFF, FAR, NEAR = 1e-3, 1e-2, 1e-4  # of the size


@dataclass
class Counts:
    """Of the runs of an integrator; worst: the largest silent error, of which scene."""

    integrator: str
    runs: int = 0
    reported: int = 0
    off: int = 0
    silent: int = 0
    silent_far: int = 0
    reported_near: int = 0
    worst: float = 0.0
    of: str = ''

    def add(self, name: str, error: float, reported: bool) -> None:
        """A run that was off by `error` of the size."""
        self.runs, self.reported = self.runs + 1, self.reported + reported
        self.off += error > OFF
        self.reported_near += reported and error < NEAR
        if not reported and error > OFF:
            self.silent, self.silent_far = self.silent + 1, self.silent_far + (error > FAR)
            if error > self.worst:
                self.worst, self.of = error, name

    def row(self) -> dict[str, str]:
        """For the table."""
        return {
            'integrator': self.integrator,
            'runs': str(self.runs),
            'reported': str(self.reported),
            'off by more than 1e-3': str(self.off),
            'of these silent': str(self.silent),
            'silent by more than 1e-2': str(self.silent_far),
            'reported, but off by less than 1e-4': str(self.reported_near),
            'worst silent error': f'{self.worst:.1e}',
            'of': self.of,
        }


def reference(scene: Scene, step: float, steps: int) -> list[Floats] | None:
    """(steps,) positions; None if there is no such motion."""
    simulation = Simulation(scene, integrator='dop853_adaptive', step=step, tolerance=1e-11)
    found = []
    try:
        for _ in range(steps):
            simulation.step()
            found.append(simulation.state.q)
    except StepError:
        return None
    return found


def compared(simulation: Simulation, exact: list[Floats]) -> tuple[float, bool]:
    """The largest error, of the size, and whether it was reported."""
    error = 0.0
    for q in exact:
        try:
            simulation.step()
        except StepError:
            return np.inf, True
        error = max(error, float(np.abs(simulation.state.q - q).max()) / simulation.model.size)
    return error, simulation.resolution.too_long


def main() -> None:
    """Run the comparison and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--runs', type=int, default=2000)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    random, counts = np.random.default_rng(options.seed), [Counts(each) for each in INTEGRATORS]
    for n in range(options.runs):
        name = str(random.choice(SCENES))
        step = float(np.exp(random.uniform(np.log(1e-3), np.log(0.3))))
        steps, scene = round(np.exp(random.uniform(np.log(3), np.log(300)))), load_scene(name)
        exact = reference(scene, step, steps)
        if exact is None:
            continue
        for each in counts:
            simulation = Simulation(scene, integrator=each.integrator, step=step)
            each.add(name, *compared(simulation, exact))
        if n % 50 == 49:
            print(f'{n + 1} of {options.runs}', file=sys.stderr, flush=True)
    rows = [each.row() for each in counts]
    for row in rows:
        print(', '.join(f'{key} {value}' for key, value in row.items()))
    path = ROOT / 'benchmark' / 'results' / 'coarse_steps.csv'
    with open(path, 'w', encoding='utf-8', newline='') as stream:
        stream.write(about() + '\n')
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == '__main__':
    main()

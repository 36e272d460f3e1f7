"""The cost of effects that a scene does not name: none.

    .venv/bin/python benchmark/absent_effects.py [--rounds 200]

Times a step of scenes without effects, in this package and in a copy of it from which the files of
all effects are deleted: two processes that stay, asked in turns, so that both meet the same
neighbours on the machine. Prints the median of the ratio of each turn, with its quartiles. Prints
also the ratio of this package to a second process of itself, which is the noise. Writes
benchmark/results/absent_effects.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros.arrays import Floats  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402

MECHANISMS = ('slider_crank', 'four_bar', 'jansen_leg', 'stewart_platform')
WORKER = """
import sys, time
from alf_ros import Simulation, load_scene
simulations = []
for mechanism in sys.argv[1].split(','):
    simulation = Simulation(load_scene({'mechanism': mechanism}))
    simulation.step(10)
    simulations.append(simulation)
loaded = [m for m in sys.modules if m.startswith('alf_ros.effects.')]
print(','.join(sorted(loaded)), flush=True)
for line in sys.stdin:
    simulation, steps = simulations[int(line)], 2000
    simulation.reset()
    started = time.perf_counter()
    simulation.step(steps)
    print(1e6 * (time.perf_counter() - started) / steps, flush=True)
"""


class Process:
    """A process that times steps of the package in `folder`."""

    def __init__(self, folder: Path, cache: Path) -> None:
        places = {'PYTHONPATH': str(folder), 'NUMBA_CACHE_DIR': str(cache)}
        self._process = subprocess.Popen(
            [sys.executable, '-c', WORKER, ','.join(MECHANISMS)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **places},
            cwd=folder,
        )
        self.loaded = self._read()

    def _read(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            sys.exit('a process has ended')
        return line.strip()

    def cost(self, which: int) -> float:
        """µs per step."""
        assert self._process.stdin is not None
        print(which, file=self._process.stdin, flush=True)
        return float(self._read())

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def without_effects(folder: Path) -> Path:
    """A copy of the package in which no effect is left but the contract."""
    for part in ('alf_ros', 'config'):
        caches = shutil.ignore_patterns('__pycache__')
        shutil.copytree(ROOT / part, folder / part, ignore=caches)
    shutil.copy(ROOT / 'package.xml', folder)
    for file in (folder / 'alf_ros/effects').glob('*.py'):
        if file.stem not in ('__init__', 'contract'):
            file.unlink()
    return folder


def measured(processes: list[Process], which: int, rounds: int) -> Floats:
    """(rounds, processes) µs per step, in turns, each time another one first."""
    costs = np.zeros((rounds, len(processes)))
    for k in range(rounds):
        for n in np.roll(np.arange(len(processes)), k).tolist():
            costs[k, n] = processes[n].cost(which)
    return costs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--rounds', type=int, default=200)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        trees = (ROOT, without_effects(place / 'bare'), ROOT)
        processes = [Process(tree, place / f'cache{n}') for n, tree in enumerate(trees)]
        for process in processes:
            assert process.loaded == 'alf_ros.effects.contract', process.loaded
        costs = [measured(processes, n, options.rounds) for n in range(len(MECHANISMS))]
        for process in processes:
            process.close()
    path = ROOT / 'benchmark/results/absent_effects.csv'
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        print(about(), file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        head = ['mechanism', 'us_installed', 'us_deleted', 'ratio', 'q25', 'q75']
        writer.writerow([*head, 'same_again', 'same_q25', 'same_q75'])
        for mechanism, cost in zip(MECHANISMS, costs, strict=True):
            installed, deleted, again = cost.T
            ratio, same = (np.quantile(installed / x, [0.5, 0.25, 0.75]) for x in (deleted, again))
            both = [f'{np.median(x):.4f}' for x in (installed, deleted)]
            spread = [f'{x:.4f}' for x in (*ratio, *same)]
            writer.writerow([mechanism, *both, *spread])
            print(
                f'{mechanism:16} {both[0]} µs installed, {both[1]} deleted: ratio {spread[0]} '
                f'({spread[1]} to {spread[2]}), of the same twice {spread[3]} '
                f'({spread[4]} to {spread[5]})'
            )


if __name__ == '__main__':
    main()

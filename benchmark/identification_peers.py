"""Identification beside MuJoCo's toolbox, on the same recordings.

    .venv/bin/python benchmark/identification_peers.py [--recordings 20] [--venv DIR]

Crank and slider of a slider-crank with friction, 2 s through four singular positions at 500 1/s,
with noise of 2e-3 rad and m. Both begin at a mass of 1 and a friction of 0.3. MuJoCo is given the
true start and one window. `identify` is given the same (`begins='scene'`), or finds the starts of
two windows. MuJoCo closes the loop by a stiff `connect` and differentiates by differences. Prints
the mean error and the scatter of the estimates, and the processor time of a fit. Writes
benchmark/results/identification_peers.csv.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PEERS = ROOT / 'benchmark' / 'peers'
sys.path[:0] = [str(ROOT), str(ROOT / 'test'), str(PEERS)]

from alf_ros import identify, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from support.recordings import SLIDER_CRANK, Machine, changed  # noqa: E402

TRUE = {'coupler.mass': 1.3, 'pin.viscous': 0.4}
BEGIN = {'coupler.mass': 1.0, 'pin.viscous': 0.3}
BOUNDS = {'coupler.mass': [0.3, 3.0], 'pin.viscous': [0.01, 2.0]}
JOINTS, DURATION, RATE, NOISE = ('crank_pin', 'guide'), 2.0, 500.0, 2e-3


def ours(machine: Machine, count: int, about: str, **options: Any) -> list[dict[str, Any]]:
    """Estimates of each recording; about: the name of these."""
    found = []
    scene = load_scene(SLIDER_CRANK)
    identify(scene, machine.recording(NOISE, 0), list(TRUE), **options)  # compiles
    for seed in range(count):
        recording = machine.recording(NOISE, seed)
        begun = time.process_time()
        fit = identify(scene, recording, list(TRUE), **options)
        spent = time.process_time() - begun
        values = dict(zip(fit.names, fit.values.tolist(), strict=True))
        found.append({'about': about, 'cpu': spent, **values})
    return found


def theirs(machine: Machine, count: int, python: str) -> list[dict[str, Any]]:
    """The same of MuJoCo's toolbox, in its environment."""
    case = {
        'theta': math.pi / 4,
        'rate': 2.0 * math.sqrt(2.0),
        'step': 1.0 / RATE,
        'bounds': BOUNDS,
        'begin': BEGIN,
        'recordings': [
            {
                't': machine.t.tolist(),
                'readings': noisy(machine, seed).tolist(),
            }
            for seed in range(count)
        ],
    }
    with tempfile.TemporaryDirectory() as folder:
        asked, said = Path(folder, 'case.json'), Path(folder, 'results.jsonl')
        asked.write_text(json.dumps(case), encoding='utf-8')
        command = [python, '-W', 'ignore', 'fit_mujoco.py', str(asked), str(said)]
        subprocess.run(command, cwd=PEERS, check=True, stdout=subprocess.DEVNULL)
        return [json.loads(line) for line in said.read_text(encoding='utf-8').splitlines()]


def noisy(machine: Machine, seed: int) -> np.ndarray[Any, Any]:
    """(n, 2) the readings of `Machine.recording` with this seed."""
    rng = np.random.default_rng(seed)
    return np.asarray(machine.x + NOISE * rng.normal(size=machine.x.shape))


def row(found: list[dict[str, Any]]) -> dict[str, str]:
    """Mean error ± its deviation, and scatter, of each number; seconds."""
    cells = {'engine': found[0]['about'], 'recordings': str(len(found))}
    for name, true in TRUE.items():
        errors = np.array([each[name] for each in found]) - true
        scatter = float(errors.std(ddof=1))
        cells[f'{name}: mean error'] = f'{errors.mean():+.1e} ± {scatter / len(errors) ** 0.5:.1e}'
        cells[f'{name}: scatter'] = f'{scatter:.1e}'
    cells['processor, s'] = f'{statistics.median(each["cpu"] for each in found):.3g}'
    return cells


def main() -> None:
    """Fit, print and write."""
    from compare import environment

    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--recordings', type=int, default=20)
    parser.add_argument('--venv', type=Path, default=PEERS / '.venv', metavar='DIR')
    options = parser.parse_args()
    machine = Machine(changed(load_scene(SLIDER_CRANK), TRUE), JOINTS, DURATION, rate=RATE)
    python = str(environment(options.venv))
    found = [
        row(ours(machine, options.recordings, 'alf_ros, start found', window=1.0)),
        row(
            ours(
                machine,
                options.recordings,
                'alf_ros, start known',
                window=DURATION,
                begins='scene',
            )
        ),
        row(theirs(machine, options.recordings, python)),
    ]
    for each in found:
        print(', '.join(f'{key} {value}' for key, value in each.items()))
    path = ROOT / 'benchmark' / 'results' / 'identification_peers.csv'
    with open(path, 'w', encoding='utf-8', newline='') as stream:
        stream.write(about() + '\n')
        writer = csv.DictWriter(stream, list(found[0]), lineterminator='\n')
        writer.writeheader()
        writer.writerows(found)


if __name__ == '__main__':
    main()

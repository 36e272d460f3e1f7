"""The cost of the readings of a sample, each beside a step of the same run.

    .venv/bin/python benchmark/readings.py [--against ANOTHER_CHECKOUT] [--rounds 300]

Prints and writes benchmark/results/readings.csv: a row for each scene, checkout and reading, with
the median processor time (us) and the ratio to the median step. Readings are made in the order of
the table of each sample, so that the first one that needs accelerations pays for them. `one call`
reads all of them at once, as the node does. `--against`: the same in turn with another checkout,
each in processes of its own.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / 'benchmark/results/readings.csv'
SCENES = ('slider_crank', 'delta_robot', 'n_four_bar, N = 1000')
COLUMNS = 'scene', 'checkout', 'reading', 'us', 'steps'
MEASURE = """
import contextlib, json, statistics, sys, time
import numpy as np
from alf_ros import Simulation, load_scene
from alf_ros.simulation.observables import READINGS

name, rounds = sys.argv[1], int(sys.argv[2])
if name.startswith('n_'):
    effects = {'gravity': {'acceleration': [0, -9.81]}}
    scene = {'mechanism': 'n_four_bar', 'parameters': {'N': 1000}, 'effects': effects}
    rounds = max(10, rounds // 10)
else:
    scene = name
sim, times = Simulation(load_scene(scene)), {}
reader, wanted = None, 0
with contextlib.suppress(ImportError):
    from alf_ros.simulation.sample_reader import KEYS, SampleReader, mask
    keys = tuple(key for key in KEYS if key != 'work')
    sample = sim.sample()
    into = {key: tuple(np.zeros(np.size(x)) for x in READINGS[key].values(sample)) for key in keys}
    reader, wanted = SampleReader(sim, into), mask(keys)

def timed(label, call):
    start = time.thread_time()
    value = call()
    times.setdefault(label, []).append(time.thread_time() - start)
    return value

for n in range(rounds + 5):
    if n == 5:  # the first ones compile
        times.clear()
    timed('step', sim.step)
    sample = timed('sample', sim.sample)
    for key, reading in READINGS.items():
        if key != 'work':
            timed(key, lambda: reading.values(sample))
    if reader:
        timed('one call', lambda: reader.read(wanted))
print(json.dumps({label: statistics.median(each) for label, each in times.items()}))
"""


def measured(checkout: Path, scene: str, rounds: int) -> dict[str, float]:
    """Median seconds of a step and of each reading."""
    command = [sys.executable, '-c', MEASURE, scene.partition(',')[0], str(rounds)]
    environment = {**os.environ, 'PYTHONPATH': str(checkout)}
    done = subprocess.run(
        command, cwd=checkout, env=environment, stdout=subprocess.PIPE, check=True, text=True
    )
    found: dict[str, float] = json.loads(done.stdout)
    return found


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--against', type=Path, metavar='CHECKOUT', help='measured as "before"')
    parser.add_argument('--rounds', type=int, default=300, metavar='N', help='steps of a run')
    parser.add_argument('--repeat', type=int, default=3, metavar='N', help='the best of so many')
    options = parser.parse_args()
    checkouts = {'before': options.against} if options.against else {}
    checkouts['now'] = ROOT
    from alf_ros.logs.provenance import about

    with open(RESULTS, 'w', newline='', encoding='utf-8') as stream:
        print(about(), file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(COLUMNS)
        for scene in SCENES:
            found: dict[str, dict[str, float]] = {}
            for _ in range(options.repeat):  # in turn: they see the same neighbours
                for label, checkout in checkouts.items():
                    now = measured(checkout, scene, options.rounds)
                    best = found.setdefault(label, now)
                    found[label] = {key: min(best[key], now[key]) for key in now}
            for label, times in found.items():
                one = times.pop('one call', None)
                times['all readings'] = sum(times.values()) - times['step']
                if one is not None:
                    times['one call'] = one
                for key, seconds in times.items():
                    ratio = seconds / times['step']
                    row = scene, label, key, f'{1e6 * seconds:.1f}', f'{ratio:.3g}'
                    writer.writerow(row)
                    print(*row, sep=', ', flush=True)


if __name__ == '__main__':
    main()

"""Make the stored results again, and compare them with the earlier results of this machine.

    make benchmark

Accuracy and cost (work_precision.csv), stiff scenes (stiff.csv), a stage of N four-bars
(stage_cost.csv), order n (order_n.csv), from a file to the first step (first_step.csv), a large
mechanism in real time (large_node.csv), the path of messages (message_path.csv), what the node
waits for (waits.csv), other engines (peers.csv), then the tables made of them.
For each curve the median ratio of costs, now over before, is printed: above 1 it is slower.
Without `--no-peers` the other engines are installed first, in an environment of their own.
"""

from __future__ import annotations

import argparse
import csv
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
RESULTS = HERE / 'results'
SCENES = ('slider_crank', 'double_four_bar')

COSTS = ('cpu_ms_per_s', 'stage_us', 'us_per_stage', 'total_s')
CURVE = (
    'scene',
    'mechanism',
    'shape',
    'file',
    'peer',
    'rate_per_s',
    'formulation',
    'integrator',
    'iterations',
)
SETTING = ('step_s', 'tolerance', 'bars', 'four_bars')
Costs = dict[tuple[str, ...], float]


def stored(name: str) -> tuple[str, dict[str, Costs]]:
    """The machine, and costs by curve and setting; nothing if there is no such file."""
    path = RESULTS / name
    if not path.is_file():
        return '', {}
    with open(path, encoding='utf-8') as stream:
        about = next(stream)
        found: dict[str, Costs] = {}
        for row in csv.DictReader(stream):
            cost = next((row[k] for k in COSTS if row.get(k)), '')
            if cost and not row.get('failure'):
                curve = ' '.join(filter(None, (row.get(k, '') for k in CURVE))) or path.stem
                setting = tuple(row.get(k, '') for k in SETTING)
                found.setdefault(curve, {})[setting] = float(cost)
    return about.partition(', Python')[0], found


def compare(before: tuple[str, dict[str, Costs]], after: tuple[str, dict[str, Costs]]) -> None:
    """Print the ratios, if the machine is the same."""
    if before[0] != after[0]:
        print(f'nothing stored from this machine ({before[0].strip() or "no file"})')
        return
    for curve, costs in after[1].items():
        old = before[1].get(curve, {})
        ratios = [cost / old[k] for k, cost in costs.items() if old.get(k)]
        if ratios:
            print(f'{statistics.median(ratios):6.2f}  {curve}')


def main() -> None:
    """Run all."""
    parser = argparse.ArgumentParser(description='Make the results in benchmark/results again.')
    parser.add_argument('--no-peers', action='store_true', help='leave out the other engines')
    options = parser.parse_args()
    measure = [sys.executable, '-m', 'alf_ros', 'work_precision', *SCENES]
    with tempfile.TemporaryDirectory() as folder:
        # fills numba's cache: what is measured then compiles nothing
        warm = [*measure, '--duration', '0.1', '--folder', folder]
        subprocess.run(warm, cwd=HERE.parent, check=True)
    commands = {'work_precision.csv': [*measure, '--folder', str(RESULTS)]}
    names = 'stiff stage_cost order_n first_step large_node message_path waits'.split()
    for name in names:
        commands[f'{name}.csv'] = [sys.executable, str(HERE / f'{name}.py')]
    if not options.no_peers:
        commands['peers.csv'] = [sys.executable, str(HERE / 'peers' / 'compare.py')]
    for name, command in commands.items():
        before = stored(name)
        if name == 'work_precision.csv':
            (RESULTS / name).unlink(missing_ok=True)  # what is there would not be measured again
        subprocess.run(command, cwd=HERE.parent, check=True)
        compare(before, stored(name))
    subprocess.run([sys.executable, str(HERE / 'tables.py')], cwd=HERE.parent, check=True)


if __name__ == '__main__':
    main()

"""What one stage evaluation costs: N four-bars, RK4 at 0.1 ms, everything of a step included.

    .venv/bin/python benchmark/stage_cost.py [--runs 5]

Prints µs per stage for N = 2 to 100,000 and writes benchmark/results/stage_cost.csv: the median of
so many processes, which load their code from numba's cache and compile nothing, and in each the
fastest of several repetitions (others use the machine too).
"""

from __future__ import annotations

import argparse
import csv
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.hard_cases import about  # noqa: E402

FOUR_BARS = (2, 10, 40, 200, 1000, 10_000, 100_000)
REPETITIONS = 15


def cost(bars: int) -> float:
    """Seconds per stage evaluation, in this process."""
    scene = load_scene('n_four_bar', parameters={'N': bars})
    simulation = Simulation(scene, step=1e-4, integrator='rk4')
    simulation.step(3)  # compiled or loaded
    steps, fastest = max(3, 10_000 // bars), float('inf')
    for _ in range(REPETITIONS):
        before, started = simulation.evaluations, time.perf_counter()
        simulation.step(steps)
        spent = time.perf_counter() - started
        fastest = min(fastest, spent / (simulation.evaluations - before))
    return fastest


def in_its_own_process(bars: int) -> float:
    """The same in a new one."""
    command = [sys.executable, __file__, '--one', str(bars)]
    return float(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--runs', type=int, default=5)
    parser.add_argument('--one', type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(cost(options.one))
        return
    in_its_own_process(FOUR_BARS[0])  # fills numba's cache
    rows = []
    for bars in FOUR_BARS:
        spent = statistics.median(1e6 * in_its_own_process(bars) for _ in range(options.runs))
        each = 1e3 * spent / bars
        print(f'N = {bars:6}: {spent:9.3f} µs a stage, {each:6.1f} ns a four-bar', flush=True)
        rows.append([bars, f'{spent:.3f}'])
    path = ROOT / 'benchmark/results/stage_cost.csv'
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        print(about(), file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(['four_bars', 'us_per_stage'])
        writer.writerows(rows)


if __name__ == '__main__':
    main()

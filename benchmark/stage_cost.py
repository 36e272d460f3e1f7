"""The cost of one stage evaluation: N four-bars, RK4 at 0.1 ms, everything of a step included.

    .venv/bin/python benchmark/stage_cost.py [--runs 5] [--against ANOTHER_CHECKOUT | --judged]

With --against: the ratio of the cost here to the cost in another checkout of this repository, in
turns, so that a machine that others use too slows both. With --judged: likewise the part that the
judgement of the length of steps costs, against the same steps without it. Else prints µs per stage
for N = 2 to 100,000 and writes benchmark/results/stage_cost.csv: the median of so many processes,
which load their code from numba's cache and compile nothing, and in each the fastest of several
repetitions.
"""

from __future__ import annotations

import argparse
import csv
import inspect
import statistics
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402

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


def answer(bars: int) -> None:
    """Seconds per stage evaluation of some 30 ms of steps, for each line of stdin."""
    scene = load_scene('n_four_bar', parameters={'N': bars})
    simulation = Simulation(scene, step=1e-4, integrator='rk4')
    simulation.step(3)
    for _ in sys.stdin:
        before, started = simulation.evaluations, time.perf_counter()
        simulation.step(max(3, 20_000 // bars))
        spent = time.perf_counter() - started
        print(spent / (simulation.evaluations - before), flush=True)


# of another checkout, whose own copy of this file may be an older one
_ANSWERS = f"""
import sys, time
sys.path.insert(0, sys.argv[1])
from alf_ros import Simulation, load_scene
{inspect.getsource(answer)}
answer(int(sys.argv[2]))
"""


def against(other: str, bars: int, turns: int = 150) -> tuple[float, float]:
    """µs a stage here, and the median ratio of this time to the time of the checkout `other`."""
    here, ratios = [], []
    for _ in range(3):
        ours, theirs = (
            subprocess.Popen(
                [sys.executable, '-c', _ANSWERS, root, str(bars)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for root in (str(ROOT), other)
        )
        with ours, theirs:
            for turn in range(turns + 1):
                spent = {}
                for process in (ours, theirs) if turn % 2 else (theirs, ours):
                    assert process.stdin is not None and process.stdout is not None
                    print(file=process.stdin, flush=True)
                    spent[process] = float(process.stdout.readline())
                if turn:  # the first waits for compiling
                    here.append(1e6 * spent[ours])
                    ratios.append(spent[ours] / spent[theirs])
    return statistics.median(here), statistics.median(ratios)


def judged(bars: int, turns: int = 300) -> tuple[float, float]:
    """µs a stage, and the median ratio to the time of the same steps without a judgement."""
    scene = load_scene('n_four_bar', parameters={'N': bars})
    plain, other = (Simulation(scene, step=1e-4, integrator='rk4') for _ in range(2))
    stepper = other._run.stepper  # a method without an estimate is not judged
    stepper.method = replace(stepper.method, estimate=np.zeros(0))
    stepper._problems.clear()
    spent: dict[bool, list[float]] = {True: [], False: []}
    for turn in range(turns + 1):
        for simulation in (plain, other) if turn % 2 else (other, plain):
            before, started = simulation.evaluations, time.perf_counter()
            simulation.step(max(3, 20_000 // bars))
            took = (time.perf_counter() - started) / (simulation.evaluations - before)
            if turn:  # the first waits for compiling
                spent[simulation is plain].append(took)
    ratios = [a / b for a, b in zip(spent[True], spent[False], strict=True)]
    return 1e6 * statistics.median(spent[True]), statistics.median(ratios)


def in_its_own_process(bars: int) -> float:
    """The same in a new one."""
    command = [sys.executable, __file__, '--one', str(bars)]
    return float(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--runs', type=int, default=5)
    parser.add_argument('--against', metavar='CHECKOUT')
    parser.add_argument('--judged', action='store_true')
    parser.add_argument('--one', type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(cost(options.one))
        return
    if options.judged:
        for bars in FOUR_BARS[:-2]:
            spent, ratio = judged(bars)
            part = 100.0 * (1.0 - 1.0 / ratio)
            print(f'N = {bars:6}: {spent:9.3f} µs a stage, judging {part:.1f} % of it', flush=True)
        return
    if options.against:
        if not (Path(options.against) / 'alf_ros/__init__.py').is_file():  # it would be this one
            parser.error(f'--against: no checkout of alf_ros: {options.against}')
        for bars in FOUR_BARS[:-2]:
            spent, ratio = against(options.against, bars)
            print(f'N = {bars:6}: {spent:9.3f} µs a stage, {ratio:.3f} of what it was', flush=True)
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

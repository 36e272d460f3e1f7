"""Many simulations in many threads: steps per second, over one thread, and over processes.

    .venv/bin/python benchmark/threads.py [--seconds 2]

Writes benchmark/results/threads.csv. Compiled calls release the interpreter's lock, so long calls
go up with the cores and reach what as many processes do, which have an interpreter each; calls of
one step also need the interpreter, and stay below. Then what the lock of a Simulation costs: a
call of one step with it and without, in turns. Nothing else should run beside it.
"""

from __future__ import annotations

import argparse
import csv
import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.logs.provenance import versions  # noqa: E402

OUTPUT = ROOT / 'benchmark' / 'results' / 'threads.csv'
SCENES = ('slider_crank', 'stewart_platform')
CALL = 0.005  # s that a long call takes, about
ROUNDS = 15


def rate(scene: str, threads: int, n: int, seconds: float) -> float:
    """Steps per second of all threads, in calls of n steps."""
    sims = [Simulation(load_scene(scene), integrator='rk4') for _ in range(threads)]
    for sim in sims:
        sim.step(1)
    end = threading.Event()

    def work(sim: Simulation) -> None:
        while not end.is_set():
            sim.step(n)
            if sim.t > 10.0:
                sim.reset()

    workers = [threading.Thread(target=work, args=(sim,)) for sim in sims]
    started = time.perf_counter()
    before = sum(sim.evaluations for sim in sims)
    for worker in workers:
        worker.start()
    time.sleep(seconds)
    end.set()
    for worker in workers:
        worker.join()
    spent = time.perf_counter() - started
    return (sum(sim.evaluations for sim in sims) - before) / sims[0].stages / spent


def rate_of_processes(scene: str, count: int, n: int, seconds: float) -> float:
    """The same of as many processes of one thread."""
    command = [sys.executable, __file__, '--child', scene, str(n), '--seconds', str(seconds)]
    pipe = subprocess.PIPE
    children = [
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) for _ in range(count)
    ]
    for child in children:
        assert child.stdout is not None and child.stdout.readline() == 'ready\n'
    for child in children:
        assert child.stdin is not None
        child.stdin.write('go\n')
        child.stdin.flush()
    return sum(float(child.communicate()[0]) for child in children)


def long_call(scene: str) -> int:
    """How many steps take CALL."""
    sim = Simulation(load_scene(scene), integrator='rk4')
    sim.step(1)
    started = time.perf_counter()
    sim.step(200)
    return max(1, int(200 * CALL / (time.perf_counter() - started)))


def lock_cost(calls: int = 3000) -> tuple[float, float]:
    """µs of a call of one step with the lock and without: medians of calls in turns."""
    sim = Simulation(load_scene('slider_crank'), integrator='rk4')
    bare = Simulation.step.__wrapped__  # type: ignore[attr-defined]
    spent: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(ROUNDS):
        for locked in (True, False):
            sim.reset()
            started = time.perf_counter()
            if locked:
                for _ in range(calls):
                    sim.step()
            else:
                for _ in range(calls):
                    bare(sim)
            spent[locked].append(1e6 * (time.perf_counter() - started) / calls)
    return min(spent[True]), min(spent[False])


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--seconds', type=float, default=2.0, help='of each measurement')
    parser.add_argument('--child', nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        scene, n = options.child
        rate(scene, 1, int(n), 0.1)
        print('ready', flush=True)
        sys.stdin.readline()
        print(rate(scene, 1, int(n), options.seconds))
        return
    cores = os.cpu_count() or 1
    rows = []
    for scene in SCENES:
        for kind, n in (('calls of 5 ms', long_call(scene)), ('calls of a step', 1)):
            counts = sorted({1, 2, cores, 2 * cores})
            rates: dict[int, list[float]] = {threads: [] for threads in counts}
            others: dict[int, list[float]] = {threads: [] for threads in counts}
            for _ in range(3):
                for threads in counts:  # in turns: what else runs here disturbs all alike
                    rates[threads].append(rate(scene, threads, n, options.seconds))
                    others[threads].append(rate_of_processes(scene, threads, n, options.seconds))
            for threads in counts:
                found = statistics.median(rates[threads])
                ratio = found / statistics.median(rates[1])
                part = found / statistics.median(others[threads])
                rows.append([scene, kind, threads, f'{found:.4g}', f'{ratio:.3g}', f'{part:.3g}'])
                told = f'{found:.4g} steps/s, {ratio:.3g} times, {part:.3g} of processes'
                print(f'{scene}, {kind}, {threads} threads: {told}')
    locked, bare = lock_cost()
    print(f'a call of one step: {locked:.3g} µs with the lock, {bare:.3g} µs without')
    rows.append(
        ['slider_crank', 'a call of one step with the lock, us', 1, f'{locked:.4g}', '', '']
    )
    rows.append(['slider_crank', 'a call of one step without, us', 1, f'{bare:.4g}', '', ''])
    with open(OUTPUT, 'w', newline='', encoding='utf-8') as stream:
        about = ', '.join(f'{k} {v}' for k, v in versions().items())
        stream.write(f'{about}; {cores} cores, load {os.getloadavg()[0]:.2f}\n')
        writer = csv.writer(stream)
        writer.writerow(['scene', 'what', 'threads', 'steps_per_s', 'over_one', 'over_processes'])
        writer.writerows(rows)


if __name__ == '__main__':
    main()

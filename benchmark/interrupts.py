"""How soon a call ends after Ctrl-C, in the main thread and in others.

    .venv/bin/python benchmark/interrupts.py [--times 20]

Writes benchmark/results/interrupts.csv: what runs, the median and the longest time in ms. A signal
comes at a random instant of a call that would take days, or within one step of 1e6 s.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import signal
import statistics
import sys
import threading
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, StepError, StoppedError, load_scene  # noqa: E402
from alf_ros.logs.provenance import versions  # noqa: E402

OUTPUT = ROOT / 'benchmark' / 'results' / 'interrupts.csv'
FOREVER = 10**12
LINKS = 1000  # four-bars of the large one
CASES: dict[str, tuple[str, dict[str, Any], dict[str, float], int]] = {
    'slider_crank, rk4': ('slider_crank', {'integrator': 'rk4'}, {}, FOREVER),
    'slider_crank, dop853_adaptive': (
        'slider_crank',
        {'integrator': 'dop853_adaptive', 'watch': True},
        {},
        FOREVER,
    ),
    'slider_crank, alf1': (
        'slider_crank',
        {'formulation': 'alf1', 'integrator': 'rk4'},
        {},
        FOREVER,
    ),
    f'{LINKS} four-bars, rk4': ('n_four_bar', {'integrator': 'rk4'}, {'N': LINKS}, FOREVER),
    'spatial_slider_crank, esdirk43, a step of 1e6 s': (
        'spatial_slider_crank',
        {'integrator': 'esdirk43', 'step': 1e6},
        {},
        1,
    ),
}


def heard(simulation: Simulation, n: int, others: bool) -> float | None:
    """ms from a signal to the end of the call, in which it came; `others`: in another thread, by
    `stop`. None if the call ended before."""
    came: list[float] = []

    def ring(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    def send() -> None:
        came.append(time.perf_counter())
        if others:
            simulation.stop()
        else:
            os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(random.uniform(0.1, 0.5), send)
    before = signal.signal(signal.SIGINT, ring)
    timer.start()
    try:
        while True:
            simulation.step(n)
    except (KeyboardInterrupt, StoppedError):
        return 1e3 * (time.perf_counter() - came[0])
    except StepError:
        try:
            timer.join()
        except KeyboardInterrupt:
            pass
        return None
    finally:
        signal.signal(signal.SIGINT, before)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--times', type=int, default=20)
    options = parser.parse_args()
    rows = []
    for name, (scene, settings, parameters, n) in CASES.items():
        simulation = Simulation(load_scene(scene, parameters), **settings)
        for kind in ('signal', 'stop'):
            found = []
            for _ in range(options.times):
                simulation.reset()
                ms = heard(simulation, n, kind == 'stop')
                if ms is not None:
                    found.append(ms)
            if not found:
                print(f'{name}: ended by itself')
                continue
            told = [f'{statistics.median(found):.3g}', f'{max(found):.3g}']
            print(f'{name}, {kind}: median {told[0]} ms, longest {told[1]} ms, {len(found)} times')
            rows.append([name, kind, *told, len(found)])
    with open(OUTPUT, 'w', newline='', encoding='utf-8') as stream:
        about = ', '.join(f'{k} {v}' for k, v in versions().items())
        stream.write(f'{about}; {os.cpu_count()} cores, load {os.getloadavg()[0]:.2f}\n')
        writer = csv.writer(stream)
        writer.writerow(['what', 'by', 'median_ms', 'longest_ms', 'times'])
        writer.writerows(rows)


if __name__ == '__main__':
    main()

"""Identification: bias, coverage and cost of fits to recordings of machines with known numbers.

    .venv/bin/python benchmark/identification.py [--refits 1000] [--workers 2] [--only gripper]

Each refit is of a recording with other noise. Bias: the mean of (estimate - truth) / deviation,
with its own deviation, 1 / √refits. Coverage: the part of the 95 % intervals that contain the
truth, and between which values it is in 19 of 20 campaigns if the intervals hold. Named: the part
of the refits in which exactly the numbers that no recording of the case tells are reported as not
determined. Far: the part in which a number is more than four deviations from the truth. Times are
of all preparation except the compilation: of the processor, and by the clock, in which windows run
on all cores.

Every refit goes into the store (default: logs/identification_refits.jsonl). A campaign that is
called again continues; `--write` makes benchmark/results/identification.csv of the store.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np
from scipy import stats

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from alf_ros import Identification, Recording, identify, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from support.gripper import GRIPPER  # noqa: E402
from support.recordings import SLIDER_CRANK, Machine, changed, pushes  # noqa: E402

STORE = ROOT / 'logs' / 'identification_refits.jsonl'
RESULTS = ROOT / 'benchmark' / 'results' / 'identification.csv'
WIDE = 1.959963984540054
TIMES = 'seconds', 'clock'
FAR = 4.0  # deviations

DELTA: dict[str, Any] = {
    'name': 'delta',
    'mechanism': 'delta_robot',
    'effects': {
        'gravity': {'acceleration': [0, 0, -9.81]},
        'joint_friction': {
            f'friction{k}': {
                'joint': f'motor{k}',
                'viscous': 0.05,
                'dynamic': 0.02,
                'load': 1.0,
                'slip': 0.1,
            }
            for k in range(3)
        },
        'motor': {
            f'servo{k}': {
                'joint': f'motor{k}',
                'position': 0.0,
                'position_gain': 40,
                'velocity_gain': 1.5,
            }
            for k in range(3)
        },
    },
    'solver': {'step': 5e-3, 'integrator': 'rk4'},
}


@dataclass(frozen=True)
class Case:
    """Numbers of a scene to fit, their true values, and a recording that is made of them.

    untold: the numbers that no such recording tells. most: refits of a campaign.
    """

    scene: Any
    true: dict[str, float]
    joints: tuple[str, ...]
    duration: float
    window: float
    effort: float
    noise: float = 0.0
    quantum: float = 0.0
    delay: float = 0.0
    untold: tuple[str, ...] = ()
    most: int = 1_000_000

    @property
    def names(self) -> list[str]:
        """Of the fit."""
        return [*self.true, *(['delay'] if self.delay else [])]

    @property
    def truth(self) -> np.ndarray[Any, Any]:
        """Of the names."""
        return np.array([*self.true.values(), *([self.delay] if self.delay else [])])

    def machine(self) -> Machine:
        """The exact motion."""
        inputs = []
        for k, joint in enumerate(self.joints if self.effort else ()):
            if joint != 'guide':
                inputs += pushes(joint, self.effort * (1.0 + 0.2 * k), self.duration, 0.2)
        inputs.sort(key=lambda each: each.t)
        of = changed(load_scene(self.scene), self.true)
        return Machine(of, self.joints, self.duration, inputs=inputs)

    def recording(self, machine: Machine, seed: int) -> Recording:
        """With noise, quantised encoders and a delay."""
        return machine.recording(self.noise, seed, self.quantum, self.delay)


TWENTY = {'platform': 0.46, 'arm': 0.44, 'rod': 0.11}
TWENTY |= {'gravity.acceleration.0': 0.05, 'gravity.acceleration.1': -0.03}
for k in range(3):
    TWENTY |= {
        f'friction{k}.slip': 0.1 + 0.01 * k,
        f'friction{k}.dynamic': 0.022 + 0.002 * k,
        f'servo{k}.position': 0.02 * k - 0.01,
        f'servo{k}.position_gain': 40.0 + 2.0 * k,
        f'servo{k}.velocity_gain': 1.5 - 0.075 * k,
    }
ENCODER = 2.0 * math.pi / 4096.0  # rad, or m
CASES = {
    'slider_crank': Case(
        SLIDER_CRANK,
        {'coupler.mass': 1.3, 'pin.viscous': 0.4},
        ('crank_pin', 'guide'),
        2.0,
        1.0,
        0.0,
        noise=2e-3,
    ),
    'slider_crank, delay, encoders': Case(
        SLIDER_CRANK,
        {'coupler.mass': 1.3, 'pin.viscous': 0.4},
        ('crank_pin', 'guide'),
        2.0,
        1.0,
        8.0,
        noise=ENCODER,
        quantum=ENCODER,
        delay=0.0123,
    ),
    'slider_crank, no known force': Case(
        SLIDER_CRANK,
        {'m': 1.2, 'pin.viscous': 0.4, 'rail.viscous': 0.25},
        ('crank_pin', 'guide'),
        2.0,
        1.0,
        0.0,
        noise=2e-3,
        untold=('m', 'pin.viscous', 'rail.viscous'),
    ),
    'gripper': Case(
        GRIPPER,
        {'finger': 0.09, 'return.stiffness': 165.0, 'oil.damping': 1.8, 'seal.viscous': 1.3},
        ('drive', 'pivot0', 'pivot1'),
        2.0,
        1.0,
        2.0,
        noise=1e-4,
        delay=0.0078,
    ),
    'delta_robot': Case(
        DELTA,
        {'arm': 0.44, 'platform': 0.46, 'friction0.viscous': 0.07, 'servo1.position_gain': 43.0},
        ('motor0', 'motor1', 'motor2'),
        2.0,
        1.0,
        6.0,
        noise=2e-4,
    ),
    'delta_robot, 20 numbers from 60 s': Case(
        DELTA,
        TWENTY,
        ('motor0', 'motor1', 'motor2'),
        60.0,
        2.0,
        6.0,
        noise=2e-4,
        most=3,
    ),
}


@cache
def machine(name: str) -> Machine:
    """Made once in each process, behind a fit of two windows, for which all is compiled."""
    short = replace(CASES[name], duration=2.0 * CASES[name].window)
    fitted(short, short.recording(short.machine(), 0))
    return CASES[name].machine()


def fitted(case: Case, recording: Recording) -> Identification:
    return identify(
        load_scene(case.scene),
        recording,
        list(case.true),
        window=case.window,
        delay=case.delay > 0.0,
    )


def refit(name: str, seed: int) -> dict[str, Any]:
    """One refit: (estimate - truth) / deviation of each number, NaN if it is not determined."""
    case = CASES[name]
    recording = case.recording(machine(name), seed)
    started, begun = time.process_time(), time.perf_counter()
    found = fitted(case, recording)
    taken, passed = time.process_time() - started, time.perf_counter() - begun
    untold = {n for n, x in zip(found.names, found.deviations, strict=True) if np.isinf(x)}
    z = (found.values - case.truth) / found.deviations
    return {
        'case': name,
        'seed': seed,
        'z': [None if n in untold else float(x) for n, x in zip(found.names, z, strict=True)],
        'seconds': taken,
        'clock': passed,
        'named': untold == set(case.untold),
        'settled': found.settled,
    }


def stored(path: Path) -> Iterator[dict[str, Any]]:
    """The refits in the store; a torn last line is none."""
    if path.exists():
        for line in path.read_text('utf-8').splitlines():
            try:
                yield json.loads(line)
            except json.JSONDecodeError:
                continue


def campaign(names: list[str], refits: int, workers: int, store: Path) -> None:
    """The refits that the store lacks, case by case, into it."""
    done = {(each['case'], each['seed']) for each in stored(store)}
    store.parent.mkdir(parents=True, exist_ok=True)
    context = get_context('spawn')
    with open(store, 'a', encoding='utf-8') as stream:
        for name in names:
            seeds = [
                seed for seed in range(min(refits, CASES[name].most)) if (name, seed) not in done
            ]
            if not seeds:
                continue
            with ProcessPoolExecutor(workers, context) as pool:
                waiting = [pool.submit(refit, name, seed) for seed in seeds]
                for n, each in enumerate(as_completed(waiting), 1):
                    stream.write(json.dumps(each.result()) + '\n')
                    stream.flush()
                    print(f'\r{name}: {n} of {len(seeds)}', end='', file=sys.stderr, flush=True)
            print(file=sys.stderr)


def known_z(refits: list[dict[str, Any]]) -> np.ndarray[Any, Any]:
    """(refits, numbers) z, zero where a number is not determined."""
    return np.nan_to_num(np.array([each['z'] for each in refits], dtype=float))


def rows(store: Path) -> Iterator[dict[str, str]]:
    """A row for each number of each case."""
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for each in stored(store):
        found.setdefault(each['case'], {})[each['seed']] = each
    for name, case in CASES.items():
        mine = list(found.get(name, {}).values())
        if not mine:
            continue
        count = len(mine)
        seconds, clock = ([each[key] for each in mine if each.get(key)] for key in TIMES)
        low, high = stats.binom.ppf([0.025, 0.975], count, 0.95) / count
        for k, number in enumerate(case.names):
            z = np.array([each['z'][k] for each in mine], dtype=float)
            told = number not in case.untold
            yield {
                'case': name,
                'number': number,
                'refits': str(count),
                'bias': f'{z.mean():+.3f}' if told else '',
                'bias_deviation': f'{count**-0.5:.3f}' if told else '',
                'coverage': f'{(np.abs(z) < WIDE).mean():.3f}' if told else '',
                'coverage_expected': f'{low:.3f} to {high:.3f}' if told else '',
                'named': f'{np.mean([each["named"] for each in mine]):.3f}',
                'far': f'{(np.abs(known_z(mine)) > FAR).any(axis=1).mean():.3f}',
                'settled': f'{np.mean([each["settled"] for each in mine]):.3f}',
                'cpu_s': f'{np.median(seconds):.3g}' if seconds else '',
                'clock_s': f'{np.median(clock):.3g}' if clock else '',
            }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--refits', type=int, default=1000)
    parser.add_argument('--workers', type=int, default=1, help='processes (default: 1)')
    parser.add_argument('--only', choices=CASES, nargs='+', default=list(CASES))
    parser.add_argument('--store', type=Path, default=STORE, help='refits so far, JSON lines')
    parser.add_argument('--write', action='store_true', help=f'write {RESULTS.name}')
    options = parser.parse_args()
    campaign(options.only, options.refits, options.workers, options.store)
    table = list(rows(options.store))
    for row in table:
        told = f'bias {row["bias"]} ± {row["bias_deviation"]}, coverage {row["coverage"]} '
        told += f'({row["coverage_expected"]})'
        if not row['bias']:
            told = f'not determined, named in {row["named"]}'
        told += f', far in {row["far"]}'
        times = f'{row["cpu_s"]} s of processor, {row["clock_s"]} s by the clock'
        print(f'{row["case"]}, {row["refits"]} refits: {row["number"]:24} {told}, {times}')
    if options.write and table:
        with open(RESULTS, 'w', encoding='utf-8', newline='') as stream:
            stream.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}\n')
            writer = csv.DictWriter(stream, table[0], lineterminator='\n')
            writer.writeheader()
            writer.writerows(table)


if __name__ == '__main__':
    main()

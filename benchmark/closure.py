"""The cost of closing loops, and the branches that are kept through dead points.

    .venv/bin/python benchmark/closure.py [--passes N] [--noisy N] [--crossings N]

Writes benchmark/results/closure.csv (cost) and closure_passes.csv (branches). A pass: a slider
drives a crank through a dead point, at a random speed that changes by up to 30 %; the crank angle
found behind it is compared with the one that made the slider's places. A motion is on the other
branch without a word if `ambiguous` is false at its end. A turn: the crank stops
before the dead point, 2 to 20 times its mean step away, and turns back. A crossing: the crank of a
random parallelogram, crossed four-bar or kite goes through its flat position. Costs are the
fastest of several repetitions (others use the machine too).
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from alf_ros import Closure, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from support.flat_four_bars import closure_of, kite, random_motion  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
COSTS = {
    'slider_crank': ('guide',),
    'four_bar': ('crank_pin',),
    'jansen_leg': ('crank_pin',),
    'rack_and_pinion': ('axle',),
    'planetary_gear': ('shaft',),
    'delta_robot': ('motor0', 'motor1', 'motor2'),
    'screw_jack': ('bearing',),
    'stewart_platform': tuple(f'leg{n}' for n in range(6)),
}
REPETITIONS, CALLS = 20, 500
MOVE = 0.05  # rad or m
R, L = 0.3, 0.8  # m
CRANK = {
    'alf': 1,
    'space': 'planar',
    'parameters': {'r': R, 'l': L, 'a': 0.7},
    'points': {
        'O': {'at': [0, 0], 'fixed': True},
        'A': {'at': ['r*cos(a)', 'r*sin(a)']},
        'B': {'at': ['r*cos(a) + sqrt(l**2 - (r*sin(a))**2)', 0]},
    },
    'bodies': {
        'crank': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'},
        'coupler': {'points': ['A', 'B'], 'mass': 1, 'inertia': 'rod'},
    },
    'joints': {
        'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
        'knee': {'type': 'revolute', 'between': ['crank', 'coupler'], 'at': 'A'},
        'guide': {'type': 'slider', 'point': 'B', 'on': {'through': [0, 0], 'direction': [1, 0]}},
    },
}
NEAR = 1e-4  # rad: the same branch
NOISES = (1e-7, 1e-6, 1e-5, 1e-4)  # m
SPEEDS = (1e-3, 0.3)  # rad per call
WARM, WARM_NOISY, ZONE = 6, 30, 9.0  # calls before a dead point; times √(noise / m), rad


def costs() -> list[dict[str, Any]]:
    """A row for each mechanism: a smooth motion of all active joints, closed in one table."""
    rows = []
    for name, active in COSTS.items():
        closure = Closure(load_scene(name), active)
        at = np.array(list(closure.start.values()))
        phase = 2.0 * np.pi * np.arange(CALLS)[:, None] / CALLS
        table = at + MOVE * np.sin(phase * (1 + np.arange(len(active))))
        closure.follow(table)
        fastest, one = np.inf, np.inf
        for _ in range(REPETITIONS):
            began = time.perf_counter()
            _, missed = closure.follow(table)
            fastest = min(fastest, (time.perf_counter() - began) / CALLS)
            began = time.perf_counter()
            for row in table[:50]:
                posture = closure.close(dict(zip(active, row.tolist(), strict=True)))
            one = min(one, (time.perf_counter() - began) / 50)
        rows.append(
            {
                'mechanism': name,
                'active': len(active),
                'coordinates': closure.model.n,
                'us_in_a_table': f'{1e6 * fastest:.1f}',
                'us_by_python': f'{1e6 * one:.1f}',
                'closed_to_m': f'{posture.closed_to:.1e}',
                'missed_by': f'{missed.max():.1e}',
            }
        )
        print(rows[-1], flush=True)
    return rows


def stroke(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The slider's places (m) at crank angles (rad)."""
    return np.asarray(R * np.cos(angle) + np.sqrt(L**2 - (R * np.sin(angle)) ** 2))


def passing(random: np.random.Generator, noise: float) -> tuple[NDArray[np.float64], float]:
    """Crank angles through a dead point, and that point (rad)."""
    speed = np.exp(random.uniform(*np.log(SPEEDS)))
    warm = WARM_NOISY if noise else WARM
    far = min(1.4, max(warm * speed, ZONE * np.sqrt(noise / 0.2)))
    count = max(8, int(2.0 * far / speed) + 1)
    phase = random.uniform(0.0, 0.1) * np.arange(count) + random.uniform(0.0, 6.0)
    steps = speed * (1.0 + random.uniform(-0.3, 0.3) * np.sin(phase))
    angle = np.cumsum(steps)
    angle -= angle[count // 2] + random.uniform(0.0, 1.0) * speed
    dead = float(random.choice([0.0, np.pi]))
    return dead + (-angle if dead == 0.0 else angle), dead


def turning(random: np.random.Generator, noise: float) -> tuple[NDArray[np.float64], float]:
    """Crank angles that come near a dead point and turn back, and that point (rad)."""
    count = int(random.integers(20, 200))
    swing = random.uniform(0.2, 1.0)
    near = random.uniform(2.0, 20.0) * 2.0 * swing / count + 2.0 * ZONE * np.sqrt(noise / 0.2)
    path = near + 0.5 * swing * (1.0 + np.cos(2.0 * np.pi * np.arange(count) / count))
    dead = float(random.choice([0.0, np.pi]))
    return (path if dead == 0.0 else dead - path), dead


def campaign(kind: str, motions: int, noise: float, seed: int) -> dict[str, Any]:
    """So many random motions; how often the crank ended on the other branch, how often without a
    word, and how many motions were called a guess."""
    closure, random = Closure(CRANK, ['guide'], noise=noise), np.random.default_rng(seed)
    pin = closure.joint_names.index('pin')
    flips = silent = guesses = calls = 0
    worst, missed_by, spent = 0.0, 0.0, 0.0
    for _ in range(motions):
        angle, dead = (passing if kind == 'pass' else turning)(random, noise)
        given = stroke(angle) + noise * random.standard_normal(angle.size)
        closure.restart()
        began = time.perf_counter()
        values, missed = closure.follow(given[:, None])
        spent += time.perf_counter() - began
        found = values[:, pin]
        error = abs(found[-1] - angle[-1])
        other = bool(error > abs(angle[-1] - dead))
        flips += other
        silent += other and not closure.ambiguous
        guesses += closure.ambiguous
        if not noise:
            worst = max(worst, float(error))
        missed_by = max(missed_by, float(missed.max()))
        calls += angle.size
    return {
        'motion': kind,
        'noise_m': f'{noise:g}',
        'motions': motions,
        'calls': calls,
        'other_branch': flips,
        'without_a_word': silent,
        'guesses': guesses,
        'worst_rad': f'{worst:.1e}' if not noise else '',
        'missed_by_m': f'{missed_by:.1e}',
        'us_a_call': f'{1e6 * spent / calls:.1f}',
    }


def crossings(motions: int, seed: int) -> dict[str, Any]:
    """So many random four-bars through their flat positions, by calls that meet them or not."""
    random = np.random.default_rng(seed)
    flips = silent = guesses = calls = 0
    worst, missed_by, spent = 0.0, 0.0, 0.0
    for _ in range(motions):
        bars, a, b, angle = random_motion(random)
        closure = closure_of(bars, a, b, float(angle[0]))
        began = time.perf_counter()
        _, missed = closure.follow(angle[1:, None])
        spent += time.perf_counter() - began
        at = closure.close({'pin': float(angle[-1])}).points['B']
        *_, x, y = bars(a, b, float(angle[-1]))
        error = math.hypot(at[0] - x, at[1] - y) / (b if bars is kite else a)
        flips += error > NEAR
        silent += error > NEAR and not closure.ambiguous
        guesses += closure.ambiguous
        worst, missed_by = max(worst, error), max(missed_by, float(missed.max()))
        calls += angle.size - 1
    return {
        'motion': 'crossing',
        'noise_m': '0',
        'motions': motions,
        'calls': calls,
        'other_branch': flips,
        'without_a_word': silent,
        'guesses': guesses,
        'worst_rad': f'{worst:.1e}',
        'missed_by_m': f'{missed_by:.1e}',
        'us_a_call': f'{1e6 * spent / calls:.1f}',
    }


def write(name: str, rows: list[dict[str, Any]]) -> None:
    with open(RESULTS / name, 'w', encoding='utf-8', newline='') as stream:
        stream.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}\n')
        table = csv.DictWriter(stream, rows[0], lineterminator='\n')
        table.writeheader()
        table.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--passes', type=float, default=1.6e6)
    parser.add_argument('--noisy', type=float, default=1e5)
    parser.add_argument('--crossings', type=float, default=1e4)
    options = parser.parse_args()
    write('closure.csv', costs())
    rows = []
    for kind in ('pass', 'turn'):
        for seed, noise in enumerate((0.0, *NOISES)):
            motions = int(options.noisy if noise or kind == 'turn' else options.passes)
            rows.append(campaign(kind, motions, noise, seed))
            print(rows[-1], flush=True)
    rows.append(crossings(int(options.crossings), 0))
    print(rows[-1], flush=True)
    write('closure_passes.csv', rows)


if __name__ == '__main__':
    main()

"""Identification: bias, coverage and cost of fits to recordings of machines with known numbers.

    .venv/bin/python benchmark/identification.py [--refits 1000] [--only slider_crank]

Each refit is of a recording with other noise. Bias: the mean of (estimate - truth) / deviation,
with its own deviation, 1 / √refits. Coverage: the part of the 95 % intervals that contain the
truth; 1000 refits of one number are within 0.936 and 0.963 in 19 of 20 cases. Times are of one
process, with all preparation except the first compilation.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from alf_ros import Recording, identify, load_scene  # noqa: E402
from support.recordings import SLIDER_CRANK, Machine, changed, pushes  # noqa: E402

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
    """Numbers of a scene to fit, their true values, and a recording that is made of them."""

    scene: Any
    true: dict[str, float]
    joints: tuple[str, ...]
    duration: float
    window: float
    effort: float
    noise: float = 0.0
    quantum: float = 0.0
    delay: float = 0.0

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
    'delta_robot': Case(
        DELTA,
        {'arm': 0.44, 'platform': 0.46, 'friction0.viscous': 0.07, 'servo1.position_gain': 43.0},
        ('motor0', 'motor1', 'motor2'),
        2.0,
        1.0,
        6.0,
        noise=2e-4,
    ),
}


def refits(case: Case, count: int) -> Iterator[tuple[np.ndarray[Any, Any], float]]:
    """(estimate - truth) / deviation of each number, and the time of the fit, s."""
    machine, delay = case.machine(), case.delay > 0.0
    truth = np.array([*case.true.values(), *([case.delay] if delay else [])])
    names = list(case.true)
    for seed in range(count + 1):
        recording, started = case.recording(machine, seed), time.perf_counter()
        found = identify(load_scene(case.scene), recording, names, window=case.window, delay=delay)
        taken = time.perf_counter() - started
        if seed:  # the first one compiles
            yield (found.values - truth) / found.deviations, taken


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--refits', type=int, default=1000)
    parser.add_argument('--only', choices=CASES)
    options = parser.parse_args()
    for name, case in CASES.items():
        if options.only in (None, name):
            print(f'{name}, {options.refits} refits')
            each = list(refits(case, options.refits))
            z = np.array([values for values, _ in each])
            for k, number in enumerate([*case.true, *(['delay'] if case.delay else [])]):
                inside = float((np.abs(z[:, k]) < 1.96).mean())
                print(
                    f'  {number:24} bias {z[:, k].mean():+.3f} ± {len(z) ** -0.5:.3f} deviations, '
                    f'coverage {inside:.3f}'
                )
            print(f'  a fit takes {np.median([taken for _, taken in each]):.3g} s (median)')


if __name__ == '__main__':
    main()

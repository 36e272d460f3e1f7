"""The time of a million slider-cranks: python benchmark/million.py [--members N] [--workers N]

Slider-cranks of ten seconds, each with another mass of the coupler (or, with `--vary L`, other
lengths), go through about eleven singular positions. They are members of a study that worker
processes run; their final and largest energies are kept. Prints the largest distance of the two
points from the same motion with steps of 1 ms, of some members; the members per second, with the
start of the workers; and how long a million takes at this rate.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from alf_ros import Simulation
from alf_ros.logs.provenance import about
from alf_ros.scene.scene import Scene
from alf_ros.studies.ensemble.crews import Processes
from alf_ros.studies.ensemble.distributions import normal
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.study_reading import study_of

DURATION, H = 10.0, 0.025  # s
# a large penalty: solves take fewer rounds, and fewer steps beside singular positions are alone
SOLVER = {'solver.integrator': ['dop853'], 'solver.step': [H], 'solver.penalty': ['1e10']}
VARIED = {'coupler.mass': normal(1.0, 0.05), 'L': normal(1.0, 0.05)}
COMPARED, INSTANTS = 8, 100
MILLION = 1_000_000


def error(scene: Scene) -> float:
    """Largest distance of A and B from the motion with steps of 1 ms, m."""
    times = np.linspace(0.0, DURATION, INSTANTS + 1).tolist()
    here, there = (
        [np.array([s.points['A'], s.points['B']]) for s in simulation.run(DURATION, at=times)]
        for simulation in (Simulation(scene), Simulation(scene, step=1e-3))
    )
    return max(
        float(np.linalg.norm(a - b, axis=1).max()) for a, b in zip(here, there, strict=True)
    )


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--members', type=int, default=20_480)
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--vary', choices=tuple(VARIED), default='coupler.mass')
    options = parser.parse_args()
    study = study_of(
        'slider_crank',
        {options.vary: VARIED[options.vary], **SOLVER},
        members=options.members,
        outputs=['final(energy)', 'max(energy)'],
        duration=DURATION,
        period=DURATION / 10,
    )
    largest = max(error(study.scene_of(k)) for k in range(COMPARED))
    print(about())
    print(f'the largest error of {COMPARED} members: {largest:.2g} m')
    start = time.perf_counter()
    found = conduct(study, None, Processes(options.workers))
    taken = time.perf_counter() - start
    failed = int((found['reason'] != '').sum())
    each = taken / options.members
    print(
        f'{options.members} members with another {options.vary}, {failed} failed, on '
        f'{options.workers} workers: {taken:.3g} s, {1.0 / each:.4g} members per second'
    )
    print(f'a million: {MILLION * each / 60.0:.3g} min')


if __name__ == '__main__':
    main()

"""The time of a million slider-cranks: python benchmark/million.py [--members N] [--workers N]

Slider-cranks of ten seconds, each with another mass of the coupler, go through about eleven
singular positions; likewise with other lengths (`--vary L`). With another length of the coupler
alone (`--vary coupler.length`) they pass beside them, or turn back. They are members of a study
that worker processes run; their final and largest energies are kept. Prints the largest
distance of the two points from the same motion with steps of 1 ms, of some members; the members
per second and the processor time of a member, without the start of the workers; how often a
member evaluates its equations, by single runs of some; and how long a million takes at this rate,
and at this processor time on processors that nothing else uses.
"""

from __future__ import annotations

import argparse
import resource
import time
from typing import Any

import numpy as np

from alf_ros import Simulation, load_scene
from alf_ros.logs.provenance import about
from alf_ros.scene.overrides import with_changes
from alf_ros.studies.ensemble.crews import Processes, ThisProcess
from alf_ros.studies.ensemble.distributions import normal
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of

DURATION = 10.0  # s
# a large penalty: solves take fewer rounds, and fewer steps beside singular positions are alone
SOLVER = {'solver.integrator': ['dop853_adaptive'], 'solver.penalty': ['3e9']}
VARIED = {
    'coupler.mass': normal(1.0, 0.05),
    'L': normal(1.0, 0.05),  # of both bodies: they still pass singular positions
    'coupler.length': normal(1.0, 0.05),  # they pass beside them, or turn back
}
TOLERANCES = {'coupler.mass': 1e-8, 'L': 1e-8, 'coupler.length': 1.5e-8}
# s; adaptive steps between. Members that turn back leave their lane for a step of the grid
GRIDS = {'coupler.mass': 0.1, 'L': 0.1, 'coupler.length': 0.025}
ENERGIES = 'final(energy)', 'max(energy)'
COMPARED, INSTANTS, COUNTED = 256, 100, 64
CHUNK = 1024  # members that a worker gets at once
MILLION = 1_000_000


def error(name: str) -> float:
    """Largest distance of A and B from the motion with steps of 1 ms, of some members, m."""
    times = np.linspace(0.0, DURATION, INSTANTS + 1).tolist()
    seen = {point: {'at': times, 'of': f'points.{point}'} for point in 'AB'}
    here, there = (
        conduct(study(COMPARED, name, seen, step), None, ThisProcess())
        for step in (GRIDS[name], 1e-3)
    )
    apart = (np.asarray(here[n], dtype=float) - np.asarray(there[n], dtype=float) for n in seen)
    return max(float(np.linalg.norm(each, axis=-1).max()) for each in apart)


def evaluations(name: str) -> float:
    """How often the single run of a member evaluates its equations, on average of some."""
    scene, total = load_scene('slider_crank'), 0
    for value in np.random.default_rng(0).normal(1.0, 0.05, COUNTED).tolist():
        simulation = Simulation(
            with_changes(scene, {name: repr(value)}),
            integrator='dop853_adaptive',
            step=GRIDS[name],
            tolerance=TOLERANCES[name],
            penalty=3e9,
        )
        simulation.step(round(DURATION / GRIDS[name]))
        total += simulation.evaluations
    return total / COUNTED


def study(members: int, name: str, outputs: Any = ENERGIES, step: float | None = None) -> Study:
    """Members that differ in one number."""
    return study_of(
        'slider_crank',
        {
            name: VARIED[name],
            **SOLVER,
            'solver.tolerance': [TOLERANCES[name]],
            'solver.step': [step or GRIDS[name]],
        },
        members=members,
        outputs=outputs,
        duration=DURATION,
        period=DURATION / 10,
        chunk=CHUNK,
    )


def conducted(made: Study, workers: int) -> tuple[int, float, float]:
    """How many members failed; duration and processor time, s."""
    start, before = time.perf_counter(), processor_time()
    found = conduct(made, None, Processes(workers))
    taken = time.perf_counter() - start
    return int((found['reason'] != '').sum()), taken, processor_time() - before


def processor_time() -> float:
    """Of this process, and of those that it began and that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + used.ru_utime + used.ru_stime


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--members', type=int, default=20_480)
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--vary', choices=tuple(VARIED), default='coupler.mass')
    options = parser.parse_args()
    few, many = (study(n, options.vary) for n in (options.workers * CHUNK, options.members))
    print(about())
    print(f'the largest error of {COMPARED} members: {error(options.vary):.2g} m')
    first, begun = conducted(few, options.workers)[1:]  # with the start of the workers
    failed, taken, used = conducted(many, options.workers)
    counted = many.members - few.members
    each, work = (taken - first) / counted, (used - begun) / counted
    print(
        f'{many.members} members with another {options.vary}, {failed} failed, on '
        f'{options.workers} workers'
    )
    print(f'{first:.3g} s until {few.members} members are done, then {1.0 / each:.4g} per second')
    print(f'{1e3 * work:.3g} ms of a processor each')
    million = (first + MILLION * each) / 60.0, MILLION * work / options.workers / 60.0
    print(f'{evaluations(options.vary):.5g} evaluations each')
    print('a million: {:.3g} min here and now, {:.3g} min on idle processors'.format(*million))


if __name__ == '__main__':
    main()

"""The cost of an ensemble beside single runs: python benchmark/ensemble.py [--members N]

Of members of the slider-crank: the time of the steps alone, of assembling a scene with other
numbers, and of a whole member; members per second in this process, with one and with two worker
processes; and the cost of chunks and a store. Ratios are of medians in one run of this program.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import TypeVar

from alf_ros import Simulation
from alf_ros.studies.ensemble.chunk import run_chunk
from alf_ros.studies.ensemble.crews import Crew, Processes, ThisProcess
from alf_ros.studies.ensemble.distributions import normal
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.member import run_member
from alf_ros.studies.ensemble.store import EnsembleStore
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of

T = TypeVar('T')


def timed(call: Callable[..., T], *arguments: object) -> tuple[T, float]:
    """The result of a call, and its duration, s."""
    start = time.perf_counter()
    found = call(*arguments)
    return found, time.perf_counter() - start


SOLVER = {'solver.integrator': ['dop853_adaptive'], 'solver.tolerance': [1e-8]}


def study(members: int, duration: float) -> Study:
    """Slider-cranks that differ in mass."""
    return study_of(
        'slider_crank',
        {'coupler.mass': normal(1.0, 0.05), **SOLVER},
        members=members,
        outputs=['final(points.B)', 'max(points.B.x)'],
        duration=duration,
        period=duration / 10,
    )


def of_one_member(duration: float, rounds: int = 15) -> None:
    """The parts of a member, medians."""
    made = study(rounds + 1, duration)
    run_member(made, rounds)  # compiles
    parts: dict[str, list[float]] = {'steps': [], 'scene': [], 'simulation': [], 'member': []}
    for k in range(rounds):
        scene, read = timed(made.scene_of, k)
        simulation, assembled = timed(Simulation, scene)
        _, stepped = timed(simulation.step, round(duration / simulation.h))
        _, whole = timed(run_member, made, k)
        for name, seconds in zip(parts, (stepped, read, assembled, whole), strict=True):
            parts[name].append(seconds)
    alone = median(parts['steps'])
    print(f'a member of {duration:g} s, in times of its steps ({1e3 * alone:.3g} ms):')
    for name in ('scene', 'simulation', 'member'):
        print(f'  {name:12}{median(parts[name]) / alone:8.3g}')


def rate(made: Study, crew: Crew) -> float:
    """Members per second, with the start of the workers."""
    return made.members / timed(conduct, made, None, crew)[1]


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--members', type=int, default=512)
    options = parser.parse_args()
    for duration in (1.0, 10.0):
        of_one_member(duration)
    made = study(options.members, 10.0)
    here = rate(made, ThisProcess())
    one, two = rate(made, Processes(1)), rate(made, Processes(2))
    print(f'members per second: {here:.3g} here, {one:.3g} with one worker, {two:.3g} with two')
    print(f'two workers: {two / one / 2:.3f} of twice one')
    with tempfile.TemporaryDirectory() as folder:
        chunk = run_chunk(made, 0)
        with EnsembleStore(Path(folder) / 'store', made) as store:
            put = median([timed(store.put, chunk)[1] for _ in range(20)])
    work = made.chunk / here
    print(f'a chunk of {made.chunk} members: writing it takes {put / work:.3%} of its work')


if __name__ == '__main__':
    main()

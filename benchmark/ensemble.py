"""The cost of an ensemble beside single runs: python benchmark/ensemble.py [--members N]

Of members of several mechanisms that are built by themselves: the time of deriving the scene from
the numbers, of building the simulation, of the steps alone, and of reading the outputs. For the
slider-crank also the time of a member beside others in this process. Ratios are of medians in one
run of this program.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from copy import copy
from statistics import median
from typing import Any, TypeVar

from alf_ros import Simulation
from alf_ros.studies.ensemble.crews import ThisProcess
from alf_ros.studies.ensemble.distributions import normal
from alf_ros.studies.ensemble.ensemble import conduct
from alf_ros.studies.ensemble.member import outputs_of, run_member
from alf_ros.studies.ensemble.study import Study
from alf_ros.studies.ensemble.study_reading import study_of

T = TypeVar('T')


def timed(call: Callable[..., T], *arguments: object) -> tuple[T, float]:
    """The result of a call, and its duration, s."""
    start = time.perf_counter()
    found = call(*arguments)
    return found, time.perf_counter() - start


SOLVER = {'solver.integrator': ['dop853_adaptive'], 'solver.tolerance': [1e-8]}
# the slider-crank of the library is off by 4e-7 m after 10 s
FIXED = {'solver.integrator': ['dop853'], 'solver.step': ['0.025']}


# a number of masses and one of lengths, which changes all shapes; of one mechanism each
VARIED: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    'slider_crank': ({'coupler.mass': normal(1.0, 0.05)}, {'L': normal(1.0, 0.05)}),
    'four_bar': ({'coupler.mass': normal(0.5, 0.02)}, {'a': normal(0.1, 0.001)}),
    'delta_robot': ({'platform': normal(0.5, 0.02)}, {'l': normal(0.45, 0.002)}),
    'stewart_platform': ({'plate': normal(20.0, 1.0)}, {'rp': normal(0.6, 0.002)}),
}


def study(
    members: int, duration: float, name: str, vary: dict[str, Any], solver: dict[str, Any]
) -> Study:
    """Mechanisms that differ in `vary`; looked at ten times."""
    return study_of(
        name,
        {**vary, **solver},
        members=members,
        outputs=['final(energy)', 'max(energy)'],
        duration=duration,
        period=duration / 10,
    )


def of_one_member(name: str, vary: dict[str, Any], duration: float, rounds: int = 15) -> None:
    """The parts of a member, medians."""
    made = study(rounds + 1, duration, name, vary, SOLVER)
    run_member(made, rounds)  # compiles
    parts: dict[str, list[float]] = {p: [] for p in ('scene', 'simulation', 'steps', 'reading')}
    for k in range(rounds):
        scene, read = timed(made.scene_of, k)
        simulation, assembled = timed(Simulation, scene)
        twin = copy(simulation)
        _, stepped = timed(twin.step, round(duration / simulation.h))
        samples = simulation.run(duration, at=made.instants[0].tolist())
        reading = timed(outputs_of, made, samples, tuple)[1] - stepped
        for part, seconds in zip(parts, (read, assembled, stepped, reading), strict=True):
            parts[part].append(seconds)
    found = {part: 1e3 * median(each) for part, each in parts.items()}
    building = (found['scene'] + found['simulation']) / found['steps']
    print(
        f'{name:17}{next(iter(vary)):13}'
        + ''.join(f'{found[part]:11.3f}' for part in parts)
        + f'{building:11.3f}'
    )


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--members', type=int, default=2048)
    options = parser.parse_args()
    print('a member of 1 s, ms of each part, and building in times of the steps:')
    heads = ('scene', 'simulation', 'steps', 'reading', 'building')
    print(f'{"":17}{"varied":13}' + ''.join(f'{head:>11}' for head in heads))
    for name, kinds in VARIED.items():
        for vary in kinds:
            of_one_member(name, vary, 1.0)
    made = study(options.members, 10.0, 'slider_crank', VARIED['slider_crank'][0], FIXED)
    alone = median([timed(run_member, made, k)[1] for k in range(15)])
    here = made.members / timed(conduct, made, None, ThisProcess())[1]
    print(f'a member of 10 s: {1e3 * alone:.3g} ms alone, {1e3 / here:.3g} ms side by side')


if __name__ == '__main__':
    main()

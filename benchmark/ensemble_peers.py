"""Members per second beside mujoco.rollout: python benchmark/ensemble_peers.py [--members N]

Slider-cranks of ten seconds that pass the singular position a dozen times and start with other
speeds, on all processors: MuJoCo with its threads and the settings of benchmark/peers, alf_ros
with members side by side in as many threads. For each error the largest step is taken whose error,
and the error of smaller steps that are tried, stay below it, against the exact motion. Neither
includes the construction of a model. Writes benchmark/results/ensemble_peers.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'benchmark' / 'peers')]

import mujoco  # noqa: E402
from mujoco import rollout  # noqa: E402
from peer_mujoco import TIMECONST, slider_crank, slider_crank_model  # noqa: E402

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.scene.overrides import with_changes  # noqa: E402
from alf_ros.simulation.side_by_side import SideBySide  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
DURATION, INSTANTS = 10.0, 100
ERRORS = 1e-3, 1e-6  # m
STEPS = [0.1 / k for k in (2, 3, 4, 5, 10, 15, 20, 30, 50, 75, 100, 150, 200, 300, 500)]
THREADS = len(os.sched_getaffinity(0))
Errors = Callable[[float], float]


def exact() -> Any:
    """(instants + 1, 2) x, y of A: with dop853 at 1 ms, within 1e-11 m."""
    simulation = Simulation(load_scene('slider_crank'), step=1e-3, integrator='dop853')
    every = round(DURATION / INSTANTS / 1e-3)
    return np.array([s.points['A'] for s in simulation.run(DURATION, every=every)])


def error_of_alf_ros(integrator: str, h: float, truth: Any) -> float:
    """Largest distance of A from the exact motion, m."""
    simulation = Simulation(load_scene('slider_crank'), step=h, integrator=integrator)
    every = round(DURATION / INSTANTS / h)
    found = np.array([s.points['A'] for s in simulation.run(DURATION, every=every)])
    return float(np.abs(found - truth).max())


def largest_step(error: Errors) -> dict[float, float]:
    """For each error the largest step that keeps it, with the smaller ones that were tried."""
    found: dict[float, float] = {}
    errors = [error(h) for h in STEPS]
    for wanted in ERRORS:
        below = [e < wanted for e in errors]
        first = next((k for k in range(len(STEPS)) if all(below[k:])), None)
        if first is not None:
            found[wanted] = STEPS[first]
    return found


def speeds_of(members: int) -> Any:
    """Factors of the speed at the start."""
    return 1.0 + 0.05 * np.arange(members) / members


def alf_ros_rate(integrator: str, h: float, members: int) -> float:
    """Members per second."""
    scene = load_scene('slider_crank')
    made = [
        Simulation(
            with_changes(scene, {'initial.velocities.B.0': repr(-4.0 * factor)}),
            step=h,
            integrator=integrator,
        )
        for factor in speeds_of(members).tolist()
    ]
    parts = [SideBySide(made[k::THREADS]) for k in range(THREADS)]
    starts = [each.state for each in made]
    times: list[float] = []
    with ThreadPoolExecutor(THREADS) as pool:
        for _ in range(4):  # the first compiles
            for each, start in zip(made, starts, strict=True):
                each.restore(start)
            begun = time.perf_counter()
            list(pool.map(lambda part: part.step(round(DURATION / h)), parts))
            times.append(time.perf_counter() - begun)
    return members / min(times[1:])


def error_of_mujoco(case: dict[str, float], h: float, truth: Any) -> float:
    """Largest distance of A from the exact motion, m; infinite for a run that ends early."""
    run, _ = slider_crank(case)
    try:
        points, _ = run(round(DURATION / INSTANTS / h), h, INSTANTS)
    except RuntimeError:
        return np.inf
    return float(np.abs(points[:, :2] - truth).max())


def mujoco_rate(case: dict[str, float], h: float, members: int) -> float:
    """Members per second."""
    model, start, speeds, _ = slider_crank_model(case)
    model.opt.timestep = h
    model.eq_solref[:] = [TIMECONST * h, 1.0]
    data = [mujoco.MjData(model) for _ in range(THREADS)]
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    states = np.zeros((members, mujoco.mj_stateSize(model, kind)))
    for state, factor in zip(states, speeds_of(members).tolist(), strict=True):
        data[0].qpos[:], data[0].qvel[:] = start, np.array(speeds) * factor
        mujoco.mj_getState(model, data[0], state, kind)
    times: list[float] = []
    with rollout.Rollout(nthread=THREADS) as rolling:
        for _ in range(2):
            begun = time.perf_counter()
            rolling.rollout(model, data, states, nstep=round(DURATION / h))
            times.append(time.perf_counter() - begun)
    return members / min(times)


def main() -> None:
    """Print and store all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--members', type=int, default=64)
    options = parser.parse_args()
    mujoco.set_mju_user_warning(lambda text: None)  # no MUJOCO_LOG.TXT
    truth = exact()
    sample = Simulation(load_scene('slider_crank')).sample()
    place, velocity = sample.points['A'], sample.velocities['A']
    rate = place[0] * velocity[1] - place[1] * velocity[0]
    case = {'theta': float(np.arctan2(place[1], place[0])), 'rate': float(rate)}
    engines: dict[str, tuple[Errors, Errors]] = {
        f'alf_ros {integrator}': (
            lambda h, i=integrator: error_of_alf_ros(i, h, truth),  # type: ignore[misc]
            lambda h, i=integrator: alf_ros_rate(i, h, options.members),  # type: ignore[misc]
        )
        for integrator in ('rk4', 'dop853')
    }
    # smaller steps take minutes
    engines[f'mujoco {mujoco.__version__}'] = (
        lambda h: error_of_mujoco(case, h, truth),
        lambda h: mujoco_rate(case, h, THREADS if h < 1e-3 else options.members),
    )
    rows: list[list[object]] = []
    print(f'{THREADS} threads')
    for name, (error, per_second) in engines.items():
        steps = largest_step(error)
        for wanted in ERRORS:
            h = steps.get(wanted)
            found = per_second(h) if h else float('nan')
            rows.append([name, wanted, h or '', found])
            told = (
                f'{found:10.4g} members per second, step {1e3 * h:.3g} ms' if h else ' not reached'
            )
            print(f'{name:16}{wanted:8.0e} m{told}', flush=True)
    with (RESULTS / 'ensemble_peers.csv').open('w', newline='') as file:
        file.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}; {THREADS} threads\n')
        writer = csv.writer(file)
        writer.writerow(['engine', 'error_m', 'step_s', 'members_per_second'])
        writer.writerows(rows)


if __name__ == '__main__':
    main()

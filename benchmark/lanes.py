"""The cost of a member in lanes beside its single run: python benchmark/lanes.py [--members N]

Of each mechanism: members that differ in gravity, from the same start, with rk4 and dop853 at
fixed steps, and with dop853_adaptive, tolerance 1e-9, on grids of a short and of a long step; the
time of a step of a member in lanes and alone, their ratio, and the part of the steps that members
took alone, beside singular positions. With as many lanes as a register has, with half a register,
and with two registers at once, as large studies step small mechanisms. The fastest of several
rounds of both, by turns, in one process. Then `Ensemble.step`. Writes benchmark/results/lanes.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Ensemble, Scene, Simulation, load_scene  # noqa: E402
from alf_ros.kernel.numba_ext.lane_numbers import width  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.scene.overrides import with_changes  # noqa: E402
from alf_ros.simulation.side_by_side import WIDTHS, SideBySide  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
SPRING = {'between': '[A, O]', 'at': '[~, ~]', 'stiffness': '30', 'free_length': '0.7'}
EFFECTS = {
    'spring': SPRING,
    'damper': {'between': '[A, B]', 'damping': '0.1'},
    'drag': {'on': 'coupler', 'linear': '0.1'},
    'joint_friction': {'joint': 'crank_pin', 'viscous': '0.1'},
}
# the name of a scene, its parameters, and effects that it has besides gravity
MECHANISMS: dict[str, tuple[str, dict[str, float], Sequence[str]]] = {
    'four-bars, N = 2': ('n_four_bar', {'N': 2}, ()),
    'four-bars, N = 10': ('n_four_bar', {'N': 10}, ()),
    'four-bars, N = 40': ('n_four_bar', {'N': 40}, ()),
    'slider_crank': ('slider_crank', {}, ()),
    'with a spring': ('slider_crank', {}, ('spring',)),
    'with viscous friction': ('slider_crank', {}, ('joint_friction',)),
    'with a spring, damper, drag': ('slider_crank', {}, ('spring', 'damper', 'drag')),
    'double_pendulum': ('double_pendulum', {}, ()),
    'delta_robot': ('delta_robot', {}, ()),
    'stewart_platform': ('stewart_platform', {}, ()),
}
SETTINGS = (
    ('rk4', 2e-3),
    ('dop853', 1e-2),
    ('dop853_adaptive', 1e-2),
    ('dop853_adaptive', 5e-2),
)  # integrator, step (s)
TOLERANCE = 1e-9  # of the adaptive one
SPAN = 1.0  # s
ROUNDS = 5
COLUMNS = 'mechanism,integrator,step_s,lanes,lanes_us,alone_us,ratio,apart'.split(',')


def scenes_of(
    name: str, parameters: Mapping[str, float], members: int, effects: Sequence[str] = ()
) -> list[Scene]:
    """Members that differ in gravity, up to 5 %."""
    given = {
        f'effects.{effect}': f'{{{", ".join(f"{k}: {v}" for k, v in EFFECTS[effect].items())}}}'
        for effect in effects
    }
    scene = with_changes(load_scene(name, parameters), given)
    (gravity,) = (effect for effect in scene.effects if effect.kind == 'gravity')
    down = np.array(gravity.parameters.acceleration)
    return [
        with_changes(
            scene, {'gravity.acceleration': str((down * (1.0 + 0.05 * k / members)).tolist())}
        )
        for k in range(members)
    ]


def measured(
    scenes: Sequence[Scene], integrator: str, h: float, lanes: int
) -> tuple[float, float, float]:
    """µs of a step of a member in lanes, and alone; and the part of the steps taken alone."""
    settings: dict[str, Any] = {'tolerance': TOLERANCE} if integrator == 'dop853_adaptive' else {}
    members = [Simulation(scene, step=h, integrator=integrator, **settings) for scene in scenes]
    together = SideBySide(members, lanes)
    starts, steps = [each.state for each in members], max(1, round(SPAN / h))
    times: tuple[list[float], list[float]] = [], []
    apart = 0.0
    for _ in range(ROUNDS + 1):  # the first compiles
        for kind in (0, 1):
            for each, start in zip(members, starts, strict=True):
                each.restore(start)
            begun = time.perf_counter()
            if kind == 0:
                together.step(steps)
                apart = together.apart / (steps * len(members))
            else:
                for each in members:
                    each.step(steps)
            times[kind].append(1e6 * (time.perf_counter() - begun) / steps / len(members))
    return min(times[0][1:]), min(times[1][1:]), apart


def in_a_loop(members: int) -> float:
    """µs of a member in a step of an `Ensemble` of slider-cranks, of one step of rk4."""
    ensemble = Ensemble(
        'slider_crank', members, efforts=['crank_pin'], step=2e-3, integrator='rk4'
    )
    efforts = np.random.default_rng(0).normal(size=(members, 1))
    times: list[float] = []
    for _ in range(50):
        begun = time.perf_counter()
        ensemble.step(efforts)
        times.append(time.perf_counter() - begun)
    return 1e6 * min(times) / members


def main() -> None:
    """Print and store all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--members', type=int, default=64)
    options = parser.parse_args()
    widths = [lanes for lanes in (width() // 2, width(), 2 * width()) if lanes in WIDTHS]
    heads = f'{"lanes":>6}{"step, ms":>10}{"together, us":>13}{"alone, us":>11}'
    print(f'{"":43}{heads}{"ratio":>7}{"apart":>7}')
    rows: list[list[object]] = []
    for label, (name, parameters, effects) in MECHANISMS.items():
        scenes = scenes_of(name, parameters, options.members, effects)
        for lanes, (integrator, h) in product(widths, SETTINGS):
            each, alone, apart = measured(scenes, integrator, h, lanes)
            rows.append([label, integrator, h, lanes, each, alone, each / alone, apart])
            print(
                f'{label:28}{integrator:>15}{lanes:6}{1e3 * h:10g}{each:13.3f}{alone:11.3f}'
                f'{each / alone:7.3f}{apart:7.3f}',
                flush=True,
            )
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / 'lanes.csv').open('w', newline='') as file:
        file.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}\n')
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    for members in (8, 1000):
        print(f'Ensemble.step of {members} slider-cranks: {in_a_loop(members):.3g} us a member')


if __name__ == '__main__':
    main()

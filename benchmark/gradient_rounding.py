"""How far a gradient is from the tangents of its run, beside what rounding does to the tangents.

    .venv/bin/python benchmark/gradient_rounding.py

Of runs of 10 s through singular passes: `apart`, the largest difference between the gradient of a
coordinate at the end and its tangents; and `last_digit`, the largest change of the tangents where
gravity changes by its last digit, up or down, twice. Both in parts of the tangent, for the worst
number. Writes gradient_rounding.csv.
"""

from __future__ import annotations

import csv
import os
from typing import Any

import numpy as np
from results_file import RESULTS  # sets the path

# isort: split
from alf_ros import Scene, Simulation, gradient, load_scene
from alf_ros.arrays import Floats
from alf_ros.logs.provenance import about
from alf_ros.scene.overrides import with_changes

SCENES = {  # a point and the numbers
    'slider_crank': (
        'B',
        ['coupler.mass', 'crank.mass', 'gravity.acceleration.1', 'initial.velocities.B.0'],
    ),
    'double_four_bar': ('B1', ['gravity.acceleration.1']),
    'change_point': ('B', ['gravity.acceleration.1']),
}
SETTINGS: dict[str, tuple[int, dict[str, Any]]] = {  # steps of 10 s
    'rk4, 3.33 ms': (3000, {'integrator': 'rk4', 'step': 1.0 / 300.0}),
    'tolerance 1e-10': (
        100,
        {'integrator': 'dop853_adaptive', 'tolerance': 1e-10, 'step': 0.1},
    ),
}
DOWN = -9.81


def tangents(
    scene: Scene, point: str, names: list[str], steps: int, settings: dict[str, Any]
) -> Floats:
    """(names,) of the point's x at the end."""
    simulation = Simulation(scene, tangents=names, **settings)
    simulation.step(steps)
    found = simulation.sample().tangents
    return np.array([found[name].points[point][0] for name in names])


def beside(scene: Scene, last_digits: int) -> Scene:
    """The scene with another gravity."""
    down = DOWN
    for _ in range(abs(last_digits)):
        down = float(np.nextafter(down, np.sign(last_digits) * np.inf))
    return with_changes(scene, {'gravity.acceleration': f'[0, {down!r}]'})


def main() -> None:
    """Print and store them."""
    body = []
    for name, (point, numbers) in SCENES.items():
        for label, (steps, settings) in SETTINGS.items():
            scene = beside(load_scene(name), 0)
            own = tangents(scene, point, numbers, steps, settings)
            found = gradient(
                Simulation(scene, **settings),
                f'final(points.{point}.x)',
                numbers,
                duration=steps * settings['step'],
                every=steps,
            )
            back = np.array([found.by[each] for each in numbers])
            moved = [
                tangents(beside(scene, digits), point, numbers, steps, settings)
                for digits in (-2, -1, 1, 2)
            ]
            apart = np.abs(back / own - 1.0).max()
            rounded = np.abs(np.array(moved) / own - 1.0).max()
            body.append((name, label, f'{apart:.0e}', f'{rounded:.0e}'))
            print(*body[-1], sep=', ', flush=True)
    with (RESULTS / 'gradient_rounding.csv').open('w', encoding='utf-8') as stream:
        stream.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}\n')
        columns = ['scene', 'settings', 'apart', 'last_digit']
        csv.writer(stream, lineterminator='\n').writerows([columns, *body])


if __name__ == '__main__':
    main()

"""This package, stepped in its own compiled loop: fixed steps, and adaptive ones by tolerance."""

from __future__ import annotations

import json
import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import measured, perform, timed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from alf_ros import Simulation, load_scene
from alf_ros.resources import version


def run(
    mechanism: str, integrator: str, n: int, h: float, instants: int = 100, **more: Any
) -> Any:
    """`n` steps of `h` between two instants."""
    simulation = Simulation(load_scene(mechanism), integrator=integrator, step=h, **more)
    simulation.step(1)
    simulation.reset()
    _, spent = timed(lambda: simulation.step(n * instants))
    simulation.reset()
    return np.array([sample.q for sample in simulation.run(n * instants * h, every=n)]), spent


def made(mechanism: str, integrator: str, case: dict[str, Any]) -> Any:
    """The function that runs a mechanism, and the energy of the mechanism, J."""
    return partial(run, mechanism, integrator), Simulation(load_scene(mechanism)).sample().energy


def adaptive() -> None:
    """Tolerances instead of steps, which end at every instant; or at every tenth, as fewer states
    are asked for."""
    with open(sys.argv[1], encoding='utf-8') as stream:
        plan = json.load(stream)
    with open(sys.argv[2], 'a', encoding='utf-8') as out:
        for mechanism, case in plan['cases'].items():
            for name, every in (('adaptive', 1), ('adaptive, a tenth of the states', 10)):
                exact, spacing = np.array(case['exact'])[::every], every * case['spacing']
                go = partial(run, mechanism, 'dop853_adaptive', 1, spacing)
                for tolerance in (10.0 ** (-k / 2.0) for k in range(6, 25)):
                    one = partial(go, tolerance=tolerance, instants=len(exact) - 1)
                    result = measured(one, exact, spacing, plan['longest'])
                    if result is None or not math.isfinite(result['cpu'] or 0.0):
                        continue
                    said = {
                        'peer': f'alf_ros {name}',
                        'about': f'alf_ros {version()}, alf2, dop853_adaptive',
                        'mechanism': mechanism,
                        'tolerance': tolerance,
                    }
                    print(json.dumps(said | result), file=out, flush=True)


if __name__ == '__main__':
    for integrator in ('rk4', 'dop853'):
        perform(
            f'alf_ros {integrator}',
            f'alf_ros {version()}, alf2, {integrator}',
            {
                name: partial(made, name, integrator)
                for name in ('slider_crank', 'double_four_bar', 'n_four_bar')
            },
        )
    adaptive()

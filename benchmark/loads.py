"""The cost of inverse dynamics, beside a stage of the forward run in the same process.

    .venv/bin/python benchmark/loads.py

Writes benchmark/results/loads.csv. An instant: efforts of all actuators for q, q̇, q̈ of a motion,
in one compiled call. A stage: one evaluation of q̈ by dop853, fixed steps. Each is the fastest of
several repetitions, which take turns (others use the machine too).
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, load_scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.studies.loads.driven_motion import Carrier, undriven  # noqa: E402
from alf_ros.studies.loads.inverse_dynamics import InverseDynamics  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
ACTUATORS = {
    'slider_crank': ('crank_pin',),
    'delta_robot': ('motor0', 'motor1', 'motor2'),
    'stewart_platform': tuple(f'leg{n}' for n in range(6)),
}
REPETITIONS, STEPS, COPIES = 30, 40, 10


def row(name: str) -> dict[str, Any]:
    """Both costs of one mechanism, in its own motion: the actuators make up for its weight, which
    is left out."""
    scene = load_scene(name)
    moving = Simulation(scene, step=1e-3, integrator='dop853')
    bare = undriven(scene, ('gravity',))
    solver = InverseDynamics(bare, ACTUATORS[name])
    path = Carrier(moving, bare).motion(list(moving.run(STEPS * 1e-3)))
    path = path.at(np.tile(np.arange(path.t.size), COPIES))
    moving.step(STEPS)
    instant = stage = np.inf
    for _ in range(REPETITIONS):
        began = time.perf_counter()
        found = solver.needed(path)
        instant = min(instant, (time.perf_counter() - began) / path.t.size)
        before, began = moving.evaluations, time.perf_counter()
        moving.step(STEPS)
        stage = min(stage, (time.perf_counter() - began) / (moving.evaluations - before))
    return {
        'mechanism': name,
        'actuators': len(ACTUATORS[name]),
        'coordinates': bare.model.n,
        'us_an_instant': f'{1e6 * instant:.1f}',
        'us_a_stage': f'{1e6 * stage:.1f}',
        'ratio': f'{instant / stage:.2f}',
        'left': f'{np.nanmax(found.short):.0e}',
    }


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    rows = []
    for name in ACTUATORS:
        rows.append(row(name))
        print(rows[-1], flush=True)
    with open(RESULTS / 'loads.csv', 'w', encoding='utf-8', newline='') as stream:
        stream.write(f'{about()}; load of the machine {os.getloadavg()[0]:.1f}\n')
        table = csv.DictWriter(stream, rows[0], lineterminator='\n')
        table.writeheader()
        table.writerows(rows)


if __name__ == '__main__':
    main()

"""The cost of watching for singular positions: a step with and without `watch=True`.

    .venv/bin/python benchmark/watching.py

Prints µs per step of both, and the difference in stages of the step: the fastest of several
repetitions each (others use the machine too).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, load_scene  # noqa: E402

SCENES = (
    'four_bar',
    'double_four_bar',
    'jansen_leg',
    'n_four_bar',
    'scissor_lift',
    'delta_robot',
    'stewart_platform',
)
REPETITIONS, STEPS = 15, 40


def main() -> None:
    for name in SCENES:
        plain, watched = (Simulation(load_scene(name), watch=watch) for watch in (False, True))
        spent = [float('inf')] * 2
        for each in (plain, watched):
            each.step(3)  # compiled or loaded; the first step of a run is looked at
        for _ in range(REPETITIONS):  # in turns, as the load of the machine changes
            for k, each in enumerate((plain, watched)):
                started = time.perf_counter()
                each.step(STEPS)
                spent[k] = min(spent[k], (time.perf_counter() - started) / STEPS)
        stages = (spent[1] - spent[0]) / spent[0] * plain.stages
        text = f'{1e6 * spent[0]:8.2f} µs a step, watched {1e6 * spent[1]:8.2f} µs'
        print(f'{name:18} {text}: {stages:5.2f} stages more', flush=True)


if __name__ == '__main__':
    main()

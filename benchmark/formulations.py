"""Largest position errors of all formulations at six steps each: the tables of doc/method.md.

    .venv/bin/python benchmark/formulations.py

RK4, all settings at their defaults, against the exact motions; for a run that stopped the time of
its last good state. Prints Markdown and writes benchmark/results/formulations.csv.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Simulation, StepError  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.simulation.formulations import NAMES  # noqa: E402
from alf_ros.studies.exact import motions  # noqa: E402
from alf_ros.studies.exact.motions import ExactMotion  # noqa: E402

PAPER = [0.01 / k for k in (5, 8, 10, 13, 19, 31)]
ODD = [5e-3 / (2.0 + more) for more in (0.0, 0.13, 0.26, 0.39, 0.52, 0.65)]
CASES = [
    (motions.paper('slider_crank'), PAPER),
    (motions.paper('double_four_bar'), PAPER),
    (motions.change_point(), ODD),
]


def run(motion: ExactMotion, formulation: str, step: float) -> str:
    """The largest error (m), or when it stopped (s)."""
    simulation = Simulation(motion.scene(), formulation=formulation, step=step)
    error = 0.0
    try:
        samples = simulation.run(motion.times[-1], at=motion.times)
        for sample, q in zip(samples, motion.exact(), strict=True):
            error = max(error, float(np.abs(sample.q - q).max()))
    except StepError as stopped:
        return f'{stopped.t:.1f} s'
    return f'{error:.0e}'.replace('e-0', 'e-')


def main() -> None:
    path = ROOT / 'benchmark/results/formulations.csv'
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        print(about(), file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(['mechanism', 'formulation', 'step_s', 'position_error_m_or_end_s'])
        for motion, steps in CASES:
            print(f'\n| {motion.mechanism} | {" | ".join(f"{1e3 * h:.3g} ms" for h in steps)} |')
            print('|---' * (len(steps) + 1) + '|')
            for name in ('alf2', *NAMES):
                found = [run(motion, name, step) for step in steps]
                print(f'| `{name}` | {" | ".join(found)} |', flush=True)
                for step, each in zip(steps, found, strict=True):
                    writer.writerow([motion.mechanism, name, f'{step:.6g}', each])


if __name__ == '__main__':
    main()

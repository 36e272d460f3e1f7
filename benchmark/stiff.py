"""Where an implicit method overtakes: a slider-crank that pushes a load on an ever stiffer spring.

    .venv/bin/python benchmark/stiff.py [--duration 3]

Writes benchmark/results/stiff.csv, a row for each stiffness and setting, and stiff.png: what
1e-4 m costs with each integrator. The load (1 kg) slides on the guide, 0.5 m ahead of the slider,
on a spring and damper with the rate ω and a damping ratio of 0.05.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from alf_ros import Scene  # noqa: E402
from alf_ros.logs.provenance import about  # noqa: E402
from alf_ros.scene.scene import scene_from_text  # noqa: E402
from alf_ros.simulation.simulation import Simulation  # noqa: E402
from alf_ros.studies.work_precision.measurement import Measurement, Setting, measure  # noqa: E402
from alf_ros.studies.work_precision.reference import SPACING, Reference, course  # noqa: E402
from alf_ros.studies.work_precision.report import CostToReach, cost_to_reach, curves  # noqa: E402

RESULTS = ROOT / 'benchmark' / 'results'
RATES = tuple(10.0 ** (0.5 * k) for k in range(3, 11))  # 1/s
RATIO = 0.05  # of the damping
TARGET = 1e-4  # m
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
STEPS = {
    'rk4': tuple(0.01 / 2**k for k in range(13)),
    'dop853': tuple(0.02 / 2**k for k in range(12)),
    'esdirk43': tuple(0.02 / 2**k for k in range(7)),
}
ADAPTIVE = ('dop853_adaptive', 'esdirk43_adaptive')
FINE = 1e-10  # tolerance of the reference
LOOK = {  # colour, marker
    'rk4': ('#56b4e9', 'o'),
    'dop853': ('#0072b2', 's'),
    'dop853_adaptive': ('#002d47', 'D'),
    'esdirk43': ('#e69f00', '^'),
    'esdirk43_adaptive': ('#d55e00', 'v'),
}
SCENE = """
name: stiff_load
mechanism:
  alf: 1
  points:
    O: {{at: [0, 0], fixed: true}}
    A: {{at: [cos(pi/4), sin(pi/4)]}}
    B: {{at: [2*cos(pi/4), 0]}}
    C: {{at: [2*cos(pi/4) + 0.5, 0]}}
  bodies:
    crank: {{points: [O, A], mass: 1, inertia: rod}}
    coupler: {{points: [A, B], mass: 1, inertia: rod}}
    load: {{points: [C], mass: 1, inertia: point}}
  joints:
    crank_pin: {{type: revolute, between: [ground, crank], at: O}}
    knee: {{type: revolute, between: [crank, coupler], at: A}}
    guide: {{type: slider, point: B, on: {{through: [0, 0], direction: [1, 0]}}}}
    rail: {{type: slider, point: C, on: {{through: [0, 0], direction: [1, 0]}}}}
effects:
  gravity: {{acceleration: [0, -9.81]}}
  spring: {{between: [B, C], stiffness: {stiffness}}}
  damper: {{between: [B, C], damping: {damping}}}
initial:
  velocities: {{B: [-4.0, 0], C: [-4.0, 0]}}
"""


def scene_of(rate: float) -> Scene:
    """The load's own rate is `rate` (1/s)."""
    return scene_from_text(SCENE.format(stiffness=rate**2, damping=2.0 * RATIO * rate))


def settings(rate: float) -> Iterator[Setting]:
    """Those that can be stable, the coarsest first."""
    for integrator, steps in STEPS.items():
        for step in steps:
            if integrator == 'esdirk43' or step * rate < 8.0:
                yield Setting('alf2', integrator, 10, step)
    for integrator in ADAPTIVE:
        for tolerance in TOLERANCES:
            yield Setting('alf2', integrator, 10, SPACING, tolerance)


def reference(scene: Scene, duration: float) -> Reference:
    """A run at a tolerance of FINE; its error is how far one at a hundred times that is off."""
    times = tuple(SPACING * k for k in range(1 + round(duration / SPACING)))

    def fine(tolerance: float) -> Simulation:
        return Simulation(scene, integrator='dop853_adaptive', step=0.01, tolerance=tolerance)

    found, other = course(fine(FINE), times), course(fine(100.0 * FINE), times)
    error = float(abs(found.q - other.q).max())
    return Reference(times, found, f'tolerance {FINE:.0e}', error, math.nan)


def measured(rate: float, duration: float) -> tuple[Reference, list[Measurement]]:
    """All settings; the finer ones of a curve only until the target is well met."""
    scene = scene_of(rate)
    against = reference(scene, duration)
    points: list[Measurement] = []
    done: set[str] = set()
    for setting in settings(rate):
        if setting.integrator not in done:
            points.append(measure(scene, setting, against))
            if points[-1].position < 0.02 * TARGET:
                done.add(setting.integrator)
    return against, points


def costs(points: list[Measurement]) -> dict[str, CostToReach]:
    """The cost of the target with each integrator that meets it."""
    found = {curve[1]: cost_to_reach(points, TARGET) for curve, points in curves(points).items()}
    return {integrator: each for integrator, each in found.items() if each is not None}


def draw(found: dict[float, dict[str, CostToReach]]) -> None:
    """benchmark/results/stiff.png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.0), layout='constrained')
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for integrator, (colour, marker) in LOOK.items():
        line = [(rate, each[integrator].cpu) for rate, each in found.items() if integrator in each]
        axes.loglog(*zip(*line, strict=True), color=colour, marker=marker, label=integrator)
    axes.set_title(f'slider-crank with a load on a spring: the cost of {1e3 * TARGET:g} mm')
    axes.set_xlabel('rate of the load on its spring, √(k/m), 1/s')
    axes.set_ylabel('processor time, ms per simulated second')
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(RESULTS / 'stiff.png', dpi=130)


def main() -> None:
    """Measure, write, draw, and say where it overtakes."""
    parser = argparse.ArgumentParser(description='What a stiff spring costs each integrator.')
    parser.add_argument('--duration', type=float, default=3.0, metavar='S', help='of each run')
    options = parser.parse_args()
    found: dict[float, dict[str, CostToReach]] = {}
    with open(RESULTS / 'stiff.csv', 'w', encoding='utf-8', newline='') as stream:
        stream.write(f'{about()}\n')
        table = csv.writer(stream)
        table.writerow(
            [
                'rate_per_s',
                'integrator',
                'step_s',
                'tolerance',
                'cpu_ms_per_s',
                'position_m',
                'evaluations_per_s',
                'reference_error_m',
                'failure',
            ]
        )
        for rate in RATES:
            against, points = measured(rate, options.duration)
            for point in points:
                setting = point.setting
                table.writerow(
                    [
                        f'{rate:.6g}',
                        setting.integrator,
                        f'{setting.step:.9g}',
                        setting.tolerance or '',
                        f'{point.cpu:.6g}',
                        f'{point.position:.3e}',
                        f'{point.evaluations:.6g}',
                        f'{against.error:.1e}',
                        point.failure,
                    ]
                )
            found[rate] = costs(points)
            said = ', '.join(f'{name} {each.cpu:.3g}' for name, each in found[rate].items())
            print(f'{rate:9.0f} 1/s: ms per s for {1e3 * TARGET:g} mm: {said}', flush=True)
    draw(found)


if __name__ == '__main__':
    main()

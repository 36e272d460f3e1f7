"""The node at 1 kHz with everything recorded and three readers, beside its goals; parts of a tick.

    .venv/bin/python benchmark/message_path.py [--against ANOTHER_CHECKOUT] [--runs 3]

Writes benchmark/results/message_path.csv: a row for each scene and checkout with medians of the
runs. The node runs in a process of its own, with readers of joint_states in three others.
`--against`: the same with another checkout, in turn. `parts` are processor times of one thread
without readers: what a tick costs beyond a step, in steps of the same process. Nothing else should
run beside it. On a busy machine only the columns in steps, and the ratio of two checkouts, mean
something.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median

from real_time import ROOT, cpu_seconds, simulator  # sets the path and the domain

# isort: split
from diagnostic_msgs.msg import DiagnosticArray
from large_node import SCENE, Diagnosed, counted, reader
from recording import RATE, gained

from alf_ros.logs.provenance import about

RESULTS = ROOT / 'benchmark/results/message_path.csv'
READERS = 3
THINNED = 'record.rate.all'  # a parameter that earlier checkouts lack
# scene, its arguments, the goal: processor of the node, % of a core, or real time
CASES = {
    'slider_crank': (['--scene', 'slider_crank'], [], '25 %'),
    'delta_robot': (['--scene', 'delta_robot'], ['-p', 'solver.step:=0.001'], '40 %'),
    'n_four_bar, N = 1000': (['--scene', 'scene.yaml'], [], 'no lost tick'),
    'the same, record.rate.all 100': (
        ['--scene', 'scene.yaml'],
        ['-p', f'{THINNED}:=100.0'],
        'no lost tick',
    ),
}
COLUMNS = (
    'scene,checkout,goal,processor_percent_of_a_core,processor_us_per_tick,ticks_per_s,lost_real_time_s_per_s,heard_per_s,'
    'dropped,step_us,topics_steps,tick_steps'
).split(',')
PARTS = """
import json, statistics, sys, tempfile, time
import rclpy
from rclpy.parameter import Parameter
from alf_ros.ros.simulator.node import Simulator, Stop
from alf_ros.ros.terminal import StatusLine

values = json.loads(sys.argv[1])
rclpy.init(args=[])
with tempfile.TemporaryDirectory() as folder:
    values |= {'record.folder': folder, 'rate': 1000.0}
    given = [Parameter(name, value=value) for name, value in values.items()]
    node = Simulator(StatusLine(False), Stop(), given)
    node.begin()
    run, times = node._control.run, {}
    for n in range(205):
        if n == 5:
            times.clear()
        for label, call in (('step', run.simulation.step), ('tick', run.tick), ('send', run.send)):
            begun = time.thread_time()
            call()
            times.setdefault(label, []).append(time.thread_time() - begun)
        time.sleep(2e-3)  # for the thread that writes
    node.close()
print(json.dumps({label: statistics.median(each) for label, each in times.items()}))
rclpy.try_shutdown()
"""


class Timed(Diagnosed):
    """Hears the diagnostics, and when (s, steady clock)."""

    def __init__(self) -> None:
        self.times: list[float] = []
        super().__init__()

    def _report(self, message: DiagnosticArray) -> None:
        self.times.append(time.monotonic())
        super()._report(message)


def measured(checkout: Path, scene: str, duration: float) -> dict[str, float]:
    """One run."""
    arguments, parameters, _ = CASES[scene]
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / 'scene.yaml').write_text(SCENE.format(bars=1000))
        listener = stack.enter_context(Timed())
        readers = [reader(folder / f'heard{n}.txt', stack) for n in range(READERS)]
        options = [*arguments, '--ros-args', '-p', f'rate:={RATE}', *parameters]
        node = simulator(folder, *options, PYTHONPATH=str(checkout))
        process = stack.enter_context(node)
        listener.until(lambda: len(listener.reports) > 2)
        listener.reports.clear()
        listener.times.clear()
        heard = [counted(path) for path in readers]
        cpu, wall = cpu_seconds(process.pid), time.monotonic()
        end = wall + duration
        listener.until(lambda: time.monotonic() > end and len(listener.times) > 2, 300.0)
        wall, cpu = time.monotonic() - wall, cpu_seconds(process.pid) - cpu
        gain = [counted(path) - before for path, before in zip(readers, heard, strict=True)]
        timing = [report['timing'] for report in listener.reports]
        dropped = int(listener.reports[-1]['record']['dropped_messages'])
        span = listener.times[-1] - listener.times[0]
    rate = gained(timing, 'ticks') / span
    return {
        'processor_percent_of_a_core': 100.0 * cpu / wall,
        'processor_us_per_tick': 1e6 * cpu / wall / rate,
        'ticks_per_s': rate,
        'lost_real_time_s_per_s': gained(timing, 'lost_real_time_s') / span,
        'heard_per_s': min(gain) / wall,
        'dropped': dropped,
    }


def parts(checkout: Path, scene: str) -> dict[str, float]:
    """Processor time of a step (us), and of topics and ticks in steps."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / 'scene.yaml'
        path.write_text(SCENE.format(bars=1000))
        (_, named), parameters, _ = CASES[scene]
        values: dict[str, object] = {'scene': str(path) if named == path.name else named}
        for text in parameters[1::2]:
            key, _, value = text.partition(':=')
            values[key] = float(value)
        done = subprocess.run(
            [sys.executable, '-c', PARTS, json.dumps(values)],
            cwd=name,
            env={**os.environ, 'PYTHONPATH': str(checkout)},
            stdout=subprocess.PIPE,
            check=True,
            text=True,
        )
    found = json.loads(done.stdout.splitlines()[-1])
    step = found['step']
    return {
        'step_us': 1e6 * step,
        'topics_steps': found['send'] / step,
        'tick_steps': found['tick'] / step,
    }


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--against', type=Path, metavar='CHECKOUT', help='measured as "before"')
    parser.add_argument(
        '--only',
        default='',
        metavar='TEXT',
        help='in the scenes; added to the results',
    )
    parser.add_argument('--runs', type=int, default=3, metavar='N')
    parser.add_argument('--duration', type=float, default=10.0, metavar='S', help='of each run')
    options = parser.parse_args()
    checkouts = {'before': options.against} if options.against else {}
    checkouts['now'] = ROOT
    chosen = {scene: case for scene, case in CASES.items() if options.only in scene}
    with open(RESULTS, 'a' if options.only else 'w', newline='', encoding='utf-8') as stream:
        said = f'{about()}; load of the machine at the start {os.getloadavg()[0]:.1f}'
        writer = csv.writer(stream, lineterminator='\n')
        if not options.only:
            print(f'{said}; medians of {options.runs} runs', file=stream)
            writer.writerow(COLUMNS)
        for scene, (_, parameters, goal) in chosen.items():
            thinned = any(THINNED in text for text in parameters)
            found: dict[str, list[dict[str, float]]] = {}
            for _ in range(options.runs):  # in turn: they see the same neighbours
                for label, checkout in checkouts.items():
                    if thinned and checkout != ROOT:
                        continue
                    one = measured(checkout, scene, options.duration) | parts(checkout, scene)
                    found.setdefault(label, []).append(one)
            for label, runs in found.items():
                middle = {key: median(run[key] for run in runs) for key in runs[0]}
                row = [scene, label, goal, *(f'{middle[key]:.4g}' for key in COLUMNS[3:])]
                writer.writerow(row)
                print(', '.join(row), flush=True)


if __name__ == '__main__':
    main()

"""The node at 1 kHz with N four-bars: what ticks, and at what lateness, with readers and a log.

    .venv/bin/python benchmark/large_node.py [--bars 1000] [--duration 20]

Four runs of `duration` seconds, with 0 and 3 other processes that subscribe to joint_states, with
and without recording. Writes benchmark/results/large_node.csv: a row for each. One tick is one
RK4 step of 1 ms; a joint state holds 3 N + 1 joints. Nothing else should run beside it.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from real_time import ROOT, cpu_seconds, simulator  # sets the path and the domain

# isort: split
from recording import RATE, Reports, gained, mean, worst

from alf_ros.logs.provenance import about

COLUMNS = (
    'subscribers,recorded,ticks_per_s,overruns,lost_real_time_s,lateness_p50_us,lateness_p99_us,'
    'worst_p99_of_a_second_us,processor_percent_of_a_core,heard_per_s,logged_mb_per_s,dropped'
).split(',')
SCENE = """
mechanism: n_four_bar
parameters: {{N: {bars}}}
effects: {{gravity: {{acceleration: [0, -9.81]}}}}
initial: {{velocities: {{B0: [1, 0]}}}}
solver: {{step: 1.0e-3, integrator: rk4, penalty: 1.0e+10}}
"""
READER = """
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node('reader')
count = [0]
def heard(_):
    count[0] += 1
qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
node.create_subscription(JointState, 'joint_states', heard, qos, raw=True)
node.create_timer(1.0, lambda: print(count[0], flush=True))
rclpy.spin(node)
"""


class Diagnosed(Reports):
    """Hears the diagnostics alone."""

    def listen(self) -> None:
        """To nothing else."""


def run(bars: int, subscribers: int, recorded: bool, duration: float) -> list[str]:
    """One row."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        listener = stack.enter_context(Diagnosed())
        (folder / 'scene.yaml').write_text(SCENE.format(bars=bars))
        options = ['--scene', str(folder / 'scene.yaml')] + ([] if recorded else ['--no-record'])
        options += ['--ros-args', '-p', f'rate:={RATE}']
        readers = [reader(folder / f'heard{n}.txt', stack) for n in range(subscribers)]
        process = stack.enter_context(simulator(folder, *options))
        listener.until(lambda: len(listener.reports) > 2)
        listener.reports.clear()
        heard = [counted(path) for path in readers]
        cpu, wall = cpu_seconds(process.pid), time.monotonic()
        end = wall + duration
        listener.until(lambda: time.monotonic() > end, duration + 60.0)
        wall = time.monotonic() - wall
        cpu = cpu_seconds(process.pid) - cpu
        gain = [counted(path) - before for path, before in zip(readers, heard, strict=True)]
        size = sum(path.stat().st_size for path in folder.glob('*/*.mcap'))
        timing = [report['timing'] for report in listener.reports]
        dropped = listener.reports[-1].get('record', {}).get('dropped_messages', '')
    span = len(timing) - 1
    numbers = [
        gained(timing, 'ticks') / span,
        gained(timing, 'overruns'),
        gained(timing, 'lost_real_time_s'),
        1e6 * mean(timing, 'lateness_p50_s'),
        1e6 * mean(timing, 'lateness_p99_s'),
        1e6 * worst(timing, 'lateness_p99_s'),
        100.0 * cpu / wall,
        min(gain, default=0) / wall,
        1e-6 * size / wall,
    ]
    return [str(subscribers), str(recorded), *(f'{number:.4g}' for number in numbers), dropped]


def reader(path: Path, stack: ExitStack) -> Path:
    """A process that subscribes, and writes how much it heard."""
    process = subprocess.Popen([sys.executable, '-c', READER], stdout=open(path, 'w'))
    stack.callback(process.wait)
    stack.callback(process.kill)
    return path


def counted(path: Path) -> int:
    """How many messages a reader has heard."""
    lines = path.read_text().split()
    return int(lines[-1]) if lines else 0


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--bars', type=int, default=1000, metavar='N', help='four-bars')
    parser.add_argument('--duration', type=float, default=20.0, metavar='S', help='of each run')
    options = parser.parse_args()
    path = ROOT / 'benchmark/results/large_node.csv'
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        print(f'{about()}; N = {options.bars}', file=stream)
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(COLUMNS)
        for subscribers in (0, 3):
            for recorded in (False, True):
                row = run(options.bars, subscribers, recorded, options.duration)
                writer.writerow(row)
                said = (f'{name} {value}' for name, value in zip(COLUMNS, row, strict=True))
                print(', '.join(said), flush=True)


if __name__ == '__main__':
    main()

"""How well the real node keeps up: 1 kHz ticks of ten four-bars while recording, and its start-up.

    .venv/bin/python benchmark/real_time.py [--duration 20] [--starts 3]

Writes benchmark/results/real_time.csv: quantity, value, unit. The node runs in a process of its
own with one subscriber to joint_states (this process); nothing else should run beside it.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
# A domain away from the default one, on this machine only; child processes inherit it.
os.environ.setdefault('ROS_DOMAIN_ID', '97')
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

import rclpy  # noqa: E402
from mcap_ros2.reader import read_ros2_messages  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from alf_ros.logs.provenance import versions  # noqa: E402

RATE = 1000.0
OUTPUT = 'output.txt'
Rows = list[tuple[str, object, str]]


@contextmanager
def simulator(
    folder: Path, *arguments: str, **environment: str
) -> Iterator[subprocess.Popen[bytes]]:
    """The node in a session of its own, stopped with SIGINT at the end."""
    command = [sys.executable, '-m', 'alf_ros', 'simulator', '--log-folder', str(folder)]
    process = subprocess.Popen(
        [*command, *arguments],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': str(ROOT), **environment},
        stdout=open(folder / OUTPUT, 'w'),
        start_new_session=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        if process.wait(30) != 0:
            raise RuntimeError(f'the node ended with {process.returncode}')


L = TypeVar('L', bound='Listener')


class Listener:
    """This process as a subscriber to joint_states; counts what arrives."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        self.context.init()
        self.node = Node('real_time_benchmark', context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.count = 0
        self.listen()

    def listen(self) -> None:
        """Subscribe to joint_states."""
        self.node.create_subscription(JointState, 'joint_states', self._heard, 1000, raw=True)

    def __enter__(self: L) -> L:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()

    def _heard(self, _: bytes) -> None:
        self.count += 1

    def until(self, condition: Callable[[], bool], limit: float = 300.0) -> float:
        """Take messages until a condition holds; returns when (s, steady clock) it did."""
        end = time.monotonic() + limit
        while not condition():
            if time.monotonic() > end:
                raise RuntimeError(f'nothing came for {limit} s')
            self._executor.spin_once(timeout_sec=0.005)
        return time.monotonic()


def cpu_seconds(pid: int) -> float:
    """Processor time of all threads of a process so far, s (Linux)."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def start_up(**environment: str) -> tuple[float, float]:
    """Seconds from starting the process to its first joint state, and until this one has it.

    The time between is discovery, by DDS: 0.1 s, or some seconds when nodes come and go quickly.
    """
    with Listener() as listener, tempfile.TemporaryDirectory() as name:
        folder, started = Path(name), time.monotonic()
        with simulator(folder, '--scene', 'n_four_bar', **environment):
            # it says so behind its first message
            made = listener.until(lambda: 'running:' in (folder / OUTPUT).read_text())
            return made - started, listener.until(lambda: listener.count > 0) - started


def keep_up(duration: float) -> Rows:
    """Run at 1 kHz for `duration` s of wall time after a first second; its log says the rest."""
    with Listener() as listener, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = ['--scene', 'n_four_bar', '--ros-args', '-p', f'rate:={RATE}']

        def spend(seconds: float) -> None:
            end = time.monotonic() + seconds
            listener.until(lambda: time.monotonic() > end)

        with simulator(folder, *options) as process:
            listener.until(lambda: listener.count > 0)
            spend(1.0)
            cpu, wall, heard = cpu_seconds(process.pid), time.monotonic(), listener.count
            spend(duration)
            wall = time.monotonic() - wall
            cpu, heard = cpu_seconds(process.pid) - cpu, listener.count - heard
        (path,) = folder.glob('*/*.mcap')
        reports = [
            {entry.key: entry.value for entry in status.values}
            for message in read_ros2_messages(str(path), topics=['/diagnostics'])
            for status in message.ros_msg.status
            if status.name.endswith((': timing', ': record'))
        ]
    timing = [report for report in reports if 'ticks' in report]
    first, last = timing[1], timing[-1]  # the first report comes before a whole second is over
    late = timing[2:]

    def gained(key: str) -> float:
        return float(last[key]) - float(first[key])

    def mean(key: str) -> float:
        return sum(float(report[key]) for report in late) / len(late)

    return [
        ('ticks received', heard / wall, 'Hz'),
        ('real-time factor', mean('real_time_factor'), '1'),
        ('overruns', gained('overruns'), '1'),
        ('real time lost', gained('lost_real_time_s'), 's'),
        ('lateness p50', 1e6 * mean('lateness_p50_s'), 'us'),
        ('lateness p99', 1e6 * mean('lateness_p99_s'), 'us'),
        ('worst p99 of a second', 1e6 * max(float(r['lateness_p99_s']) for r in late), 'us'),
        ('processor', 100.0 * cpu / wall, '% of one core'),
        ('messages logged', int(reports[-1]['written_messages']), '1'),
        ('messages dropped', int(reports[-1]['dropped_messages']), '1'),
        ('duration', wall, 's'),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument(
        '--duration', type=float, default=20.0, metavar='S', help='of the 1 kHz run'
    )
    parser.add_argument('--starts', type=int, default=3, metavar='N', help='warm starts')
    options = parser.parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as cache:
        cold, _ = start_up(NUMBA_CACHE_DIR=cache)
        # the same start again, now with that cache
        warm = [start_up(NUMBA_CACHE_DIR=cache) for _ in range(options.starts)]
    made, heard = (sorted(times) for times in zip(*warm, strict=True))
    rows: Rows = [
        ('load average before the start', load, '1'),
        ('start to first joint state, cold', cold, 's'),
        ('start to first joint state, warm, median', made[len(made) // 2], 's'),
        ('the same, heard in another process', heard[len(heard) // 2], 's'),
        *keep_up(options.duration),
    ]
    about: dict[str, Any] = {
        **versions(),
        'cores': os.cpu_count(),
        'date': time.strftime('%Y-%m-%d'),
    }
    path = ROOT / 'benchmark/results/real_time.csv'
    path.parent.mkdir(exist_ok=True)
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['quantity', 'value', 'unit'])
        for name, value, unit in rows:
            shown = f'{value:.4g}' if isinstance(value, float) else value
            print(f'{name:41} {shown:>10} {unit}')
            writer.writerow([name, shown, unit])
        writer.writerows([name, value, ''] for name, value in about.items())
    print(f'{platform.node()}: {path.relative_to(ROOT)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())

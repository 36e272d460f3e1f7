"""From a command to the state that shows it, in another process: p50 and p99; and under a flood.

    .venv/bin/python benchmark/latency.py [--commands 500]

Writes benchmark/results/latency.csv: quantity, value, unit. An effort is published on
`joint_commands`, every time another one, and waited for in `joint_states`, which this process
hears at the rate of the simulator; half a tick of it is the wait for the next tick. Nothing else
should run beside it.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from real_time import OUTPUT, ROOT, Listener, Rows, cpu_seconds, simulator
from sensor_msgs.msg import JointState

from alf_ros.logs.provenance import versions

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
FLOOD = 10_000.0
# Scene, its joint, ticks a second.
CASES = (('slider_crank', 'knee', 500.0), ('n_four_bar', 'pin0', 1000.0))


class Commander(Listener):
    """Publishes efforts, and hears the newest joint state whole."""

    def __init__(self, joint: str) -> None:
        super().__init__()
        self.joint, self.effort = joint, 0.0
        self._publisher = self.node.create_publisher(JointState, 'joint_commands', 10)

    def listen(self) -> None:
        """Subscribe to joint_states: the newest alone."""
        self.node.create_subscription(JointState, 'joint_states', self._seen, NEWEST)

    def _seen(self, state: JointState) -> None:
        self.count += 1
        self.effort = state.effort[state.name.index(self.joint)]

    def send(self, effort: float) -> None:
        self._publisher.publish(JointState(name=[self.joint], effort=[effort]))

    def send_often(self, rate: float, duration: float) -> tuple[int, float]:
        """Number sent and seconds it took, at `rate` (Hz) if one core can."""
        data = serialize_message(JointState(name=[self.joint], effort=[1e-6]))
        sent, started = 0, time.monotonic()
        while (passed := time.monotonic() - started) < duration:
            while sent < rate * passed:
                self._publisher.publish(data)
                sent += 1
        return sent, passed

    def wait(self, effort: float) -> float:
        """Until joint_states show an effort; returns when (s, steady clock) they did."""
        return self.until(lambda: self.effort == effort)


def measure(scene: str, joint: str, rate: float, commands: int) -> Rows:
    """Commands one by one, at instants that have nothing to do with the ticks; then a flood."""
    chance = random.Random(1)
    with Commander(joint) as commander, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = ['--scene', scene, '--ros-args', '-p', f'rate:={rate}']
        with simulator(folder, *options) as process:
            commander.until(lambda: 'running:' in (folder / OUTPUT).read_text())
            commander.until(lambda: commander.count > 0)
            commander.send(1e-3)
            commander.wait(1e-3)
            times = []
            for n in range(commands):
                pause = time.monotonic() + chance.uniform(0.002, 0.02)
                commander.until(lambda end=pause: time.monotonic() > end)  # type: ignore[misc]
                started = time.monotonic()
                commander.send(1e-6 * n)
                times.append(commander.wait(1e-6 * n) - started)
            cpu = cpu_seconds(process.pid)
            sent, passed = commander.send_often(FLOOD, 5.0)
            cpu = (cpu_seconds(process.pid) - cpu) / passed
            started = time.monotonic()
            commander.send(2e-3)
            after = commander.wait(2e-3) - started
            commander.until(lambda end=started + 2.5: time.monotonic() > end)  # type: ignore[misc]
        lost = timing(folder)
    times.sort()
    about = f'{scene} at {rate:g} Hz: '
    return [
        (f'{about}command to state p50', 1e6 * times[len(times) // 2], 'us'),
        (f'{about}command to state p99', 1e6 * times[len(times) * 99 // 100], 'us'),
        (f'{about}flood', sent / passed, 'commands/s'),
        (f'{about}flood, processor', 100.0 * cpu, '% of one core'),
        (f'{about}flood, real time lost', lost, 's'),
        (f'{about}flood, last command to state', 1e6 * after, 'us'),
    ]


def timing(folder: Path) -> float:
    """Real time lost (s) in the run, from its log."""
    from mcap_ros2.reader import read_ros2_messages

    (path,) = folder.glob('*/*.mcap')
    reports = [
        {entry.key: entry.value for entry in status.values}
        for message in read_ros2_messages(str(path), topics=['/diagnostics'])
        for status in message.ros_msg.status
        if status.name.endswith(': timing')
    ]
    return float(reports[-1]['lost_real_time_s'])


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--commands', type=int, default=500, metavar='N', help='in each scene')
    options = parser.parse_args()
    rows: Rows = [('load average before the start', os.getloadavg()[0], '1')]
    for scene, joint, rate in CASES:
        rows += measure(scene, joint, rate, options.commands)
    about: dict[str, Any] = {
        **versions(),
        'cores': os.cpu_count(),
        'date': time.strftime('%Y-%m-%d'),
    }
    path = ROOT / 'benchmark/results/latency.csv'
    with open(path, 'w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['quantity', 'value', 'unit'])
        for name, value, unit in rows:
            shown = f'{value:.4g}' if isinstance(value, float) else value
            print(f'{name:56} {shown:>10} {unit}')
            writer.writerow([name, shown, unit])
        writer.writerows([name, value, ''] for name, value in about.items())
    print(f'{platform.node()}: {path.relative_to(ROOT)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
